"""The entry of one log format in the table: all that is known of it, beside its reader and writer.

A format is a module of :mod:`clutchest.can.formats` whose entry is called ``FORMAT``; no other
module mentions it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.can.log_source import LogSource

Sniff = Callable[[bytes], int | None]
Reader = Callable[[LogSource], Iterator[Frames]]
TextWriter = Callable[[Frames], Iterator[bytes]]
FileWriter = Callable[[Frames, Path], None]


@dataclass(frozen=True, slots=True)
class Loss:
    """Something that a format has no place for.

    ``what`` in a few words; ``count`` how many of the given frames it concerns; ``words`` the
    warning behind the suffix when such a file is written, ``{n}`` standing for that number.
    """

    what: str
    words: str
    count: Callable[[Frames], int]


def never(suffix: str) -> bool:
    """For formats that are recognised by their content only."""
    return False


@dataclass(frozen=True, slots=True)
class LogFormat:
    """One kind of log file.

    ``title`` names it in messages, ``about`` in the documentation.  ``suffix`` is the one by which
    it is written, empty where it cannot be.  ``sniff`` gives the position in the first bytes of a
    file at which its content shows, None where it does not: of several formats the earliest counts.
    ``by_suffix``: whether files of a suffix are of this format where no content decides.
    ``read`` gives the frames of an open log block by block.  One of ``lines`` (the file in pieces)
    and ``save`` (to a path) writes; ``losses`` is what the format cannot carry.  Libraries that
    only this format needs are imported within these functions.
    """

    title: str
    about: str
    read: Reader
    suffix: str = ""
    sniff: Sniff = lambda head: None
    by_suffix: Callable[[str], bool] = never
    lines: TextWriter | None = None
    save: FileWriter | None = None
    losses: tuple[Loss, ...] = ()

    @property
    def writable(self) -> bool:
        """Whether frames can be written in this format."""
        return self.lines is not None or self.save is not None

    def lost(self, frames: Frames) -> tuple[str, ...]:
        """What of ``frames`` the format cannot carry, in words."""
        counted = [(loss, loss.count(frames)) for loss in self.losses]
        return tuple(f"{self.suffix} {loss.words.format(n=n)}" for loss, n in counted if n)


def begins_with(*marks: bytes) -> Sniff:
    """Known by one of these first bytes."""
    return lambda head: 0 if head.startswith(marks) else None


def has_line(pattern: bytes, flags: int = 0) -> Sniff:
    """Known by a line that begins like ``pattern``, a regular expression."""
    expression = re.compile(b"^(?:" + pattern + b")", re.MULTILINE | flags)

    def sniff(head: bytes) -> int | None:
        match = expression.search(head)
        return match.start() if match else None

    return sniff


def flagged(flags: Flag) -> Callable[[Frames], int]:
    """How many frames have any of ``flags``."""
    return lambda frames: int(np.count_nonzero(frames.flags & flags))


def on_other_channels(frames: Frames) -> int:
    """How many frames are not on the first frame's channel."""
    return int(np.count_nonzero(frames.channel != frames.channel[:1]))


# python-can's csv and SQLite
NO_CHANNELS = Loss("channels", "cannot tell the channels apart", on_other_channels)
NO_DIRECTION = Loss(
    "direction, bit-rate switch and error state",
    "cannot hold direction, bit rate switch and error state",
    flagged(Flag.BITRATE_SWITCH | Flag.ERROR_STATE | Flag.SENT),
)
