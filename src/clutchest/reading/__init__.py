"""From logs of any kind to the canonical signals of a drive."""

from clutchest.reading.log import load_database, read_log

__all__ = ["load_database", "read_log"]
