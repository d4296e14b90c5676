"""From logs of any kind to the canonical signals of a drive."""

from clutchest.reading.log import Logs, as_signals, load_database, read_log

__all__ = ["Logs", "as_signals", "load_database", "read_log"]
