"""Csv of Kvaser's converters: ``Time,Channel,id,Flags,DLC,Data0,…,Data7,Counter``.

Its head states whether ids and bytes are decimal; flags are the bits of CANlib's messages, and an
error frame has no id.  Source: Kvaser, kvlclib's writer of csv frames.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from clutchest.can.csv_frames import frames_of
from clutchest.can.csv_header import Header, header_of, headers
from clutchest.can.frames import Frames
from clutchest.can.log_format import LogFormat
from clutchest.can.log_source import LogSource
from clutchest.can.text_times import local_date_ns

_FIRST = ("time", "channel", "id", "flags", "dlc", "data0")
_BASE = r"Format of {} field\W(HEX|DEC)"
_START = re.compile(rb"^Logging started at\W([^\r\n]*)", re.MULTILINE)


def _is_own(header: Header) -> bool:
    return tuple(name.lower() for name in header.names[: len(_FIRST)]) == _FIRST


def _sniff(head: bytes) -> int | None:
    return next((h.begin for h in headers(head) if _is_own(h)), None)


def _is_decimal(head: bytes, of: str) -> bool:
    stated = re.search(_BASE.format(of).encode(), head)
    return stated is None or stated[1] == b"DEC"


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of such a log; lines that cannot be read are counted in ``rejected``."""
    header = header_of(source, _is_own)
    head = source.head[: header.begin]
    started = _START.search(head)
    start_ns = local_date_ns(started[1]) if started else None
    named = replace(header, names=(*header.names[:3], "CANlib flags", *header.names[4:]))
    for frames in frames_of(
        source,
        named,
        10**9,
        decimal_ids=_is_decimal(head, "id"),
        decimal_data=_is_decimal(head, "data"),
        first_channel=1,
    ):
        if start_ns is not None and not frames.absolute:
            frames = replace(frames, t_ns=frames.t_ns + start_ns, absolute=True)
        yield frames


FORMAT = LogFormat(
    title="Kvaser csv",
    about="Kvaser's, decimal or hexadecimal, flags as a number",
    suffix=".csv",
    sniff=_sniff,
    read=read,
)
