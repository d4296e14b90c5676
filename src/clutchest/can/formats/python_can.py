"""Every format without an entry of its own that python-can knows, plug-ins included."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource, quiet
from clutchest.can.python_can_messages import blocks_of
from clutchest.can.time_stamps import counts_from_epoch
from clutchest.errors import ClutchestError


@cache
def _suffixes() -> frozenset[str]:
    from importlib.metadata import entry_points

    from can.io.player import MESSAGE_READERS

    plugged = {plug.name for plug in entry_points(group="can.io.message_reader")}
    return frozenset(set(MESSAGE_READERS) | plugged)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames as python-can reads them; what precedes a damaged place is kept."""
    from can import LogReader

    if source.zipped:
        raise ClutchestError(f"{source.path}: this format cannot be read gzipped, unpack it first")
    with quiet("can"):
        try:
            reader = LogReader(source.path)
        except Exception as error:  # every format's library has its own
            raise ClutchestError(
                f"{source.path}: the file is damaged ({type(error).__name__}: {error})"
            ) from None
        with reader:
            absolute = None
            for frames in blocks_of(reader):
                if absolute is None and len(frames):
                    absolute = counts_from_epoch(frames.t_ns)
                yield replace(frames, absolute=absolute is not False)


FORMAT = LogFormat(
    title="others that python-can reads",
    about="whatever else python-can reads, its plug-ins included; not gzipped",
    read=read,
    by_suffix=lambda suffix: suffix in _suffixes(),
)
