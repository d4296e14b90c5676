"""PEAK's text log, version 2.1."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from clutchest.can.frames import Flag, Frames
from clutchest.can.writers.asc import LENGTH_CODE
from clutchest.can.writers.text import Lines, decimals, has, written

_DAY_0_S = 25569 * 86400  # from 30 December 1899 to 1 January 1970
# type → flags of its frames
_TYPES = {
    "DT": Flag(0),
    "RR": Flag.REMOTE,
    "FD": Flag.FD,
    "FB": Flag.FD | Flag.BITRATE_SWITCH,
    "FE": Flag.FD | Flag.BITRATE_SWITCH | Flag.ERROR_STATE,
    "BI": Flag.FD | Flag.ERROR_STATE,
}
_KIND = Flag.FD | Flag.BITRATE_SWITCH | Flag.ERROR_STATE | Flag.REMOTE


def write(frames: Frames) -> Iterator[bytes]:
    """The log in pieces, error frames left out.  It starts at a full second."""
    start_s = int(frames.t_ns.min(initial=0 if not len(frames) else frames.t_ns[0])) // 10**9
    start_s = start_s if frames.absolute else 0
    yield (
        ";$FILEVERSION=2.1\n"
        f";$STARTTIME={(start_s + _DAY_0_S) / 86400!r}\n"
        ";$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n;   Written by clutchest\n"
        ";-------------------------------------------------------------------------------\n"
        ";   Message   Time    Type    ID     Rx/Tx\n"
        ";   Number    Offset  |  Bus  [hex]  |  Reserved\n"
        ";   |         [ms]    |  |    |      |  |  Data Length Code\n"
        ";   |         |       |  |    |      |  |  |    Data [hex] ...\n"
        ";---+-- ------+------ +- +- --+----- +- +- +--- +- -- -- -- -- -- -- --\n"
    ).encode()
    places, number = decimals(frames, 3), 0

    def line(piece: Frames) -> Lines:
        nonlocal number
        n = len(piece)
        sent, remote = has(piece, Flag.SENT), has(piece, Flag.REMOTE)
        lines = Lines(n).put("  ").number(np.arange(number + 1, number + n + 1)).put(" ")
        lines.point(piece.t_ns - start_s * 10**9, 10**6, places).put(" ")
        for name, flags in _TYPES.items():
            lines.put(name, (piece.flags & _KIND) == flags)
        lines.put(" ").number(piece.channel.astype(int) + 1).put(" ")
        lines.hexadecimal(piece.id, np.where(has(piece, Flag.EXTENDED), 8, 4))
        lines.put(" Rx - ", ~sent).put(" Tx - ", sent).number(LENGTH_CODE[piece.length])
        number += n
        return lines.payload(piece, ~remote, " ")

    yield from written(frames.take((frames.flags & Flag.ERROR) == 0), line)
