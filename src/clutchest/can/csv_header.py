"""What the header of a table of frames says of its columns, and what their first rows add."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from clutchest.can.log_source import LogSource
from clutchest.errors import ClutchestError

SKIP, TIME, ID, CHANNEL, LENGTH, DATA, BYTE = range(7)
IS_EXTENDED, IS_REMOTE, IS_ERROR, IS_SENT, IS_FD, IS_FAST, IS_PASSIVE, KIND, BITS = range(7, 16)
_UNIT = r"(s|sec|secs|seconds?|ms|msec|milliseconds?|us|usec|microseconds?|ns|nsec|nanoseconds?)?"
_NAMED = {
    TIME: rf"(time|timestamps?|timestampepoch|epoch|abstime|reltime|relativetime|timeoffset"
    rf"|frametimeepoch|frametimerelative|zeit|zeitstempel){_UNIT}",
    ID: r"(can|can_)?id|arbid|arbitrationid|identifier|canidentifier|addr|address|messageid|msgid"
    r"|frameid|idhex|iddec",
    IS_EXTENDED: r"extended|xtd|ext|ide|extendedid|isextended|isextendedid|canflagsxtd",
    IS_REMOTE: r"remote|rtr|remoteframe|isremote|isremoteframe|canflagsrtr",
    IS_ERROR: r"er|err|error|errorframe|iserror|iserrorframe|canflagserr",
    IS_SENT: r"dir|direction|tx|rxtx|txrx|richtung",
    IS_FD: r"edl|fdf|fd|canfd|isfd",
    IS_FAST: r"brs|bitrateswitch",
    IS_PASSIVE: r"esi|errorstateindicator",
    KIND: r"type|frametype|msgtype|messagetype|idtype|format|frameformat|idformat|typ",
    CHANNEL: r"bus|buschannel|channel|chn|chan|ch|network|canchannel|busnumber|interface|kanal",
    BITS: r"canlibflags",
    LENGTH: r"len|length|datalength|dlc|size|datalen|datasize|bytes|canlen|lnge|laenge",
    DATA: r"data|databytes|payload|datahex|datadec|datafield|datadata|daten",
    BYTE: r"[db]\d+|data\d+|byte\d+|databyte\d+",
}
_UNITS_NS = {"n": 1, "u": 1_000, "µ": 1_000, "micro": 1_000, "m": 1_000_000, "milli": 1_000_000}
_STATED = re.compile(
    r"(?:[\[(]\s*|_|\b|(?<=time)|(?<=timestamp))"
    r"(nano|micro|milli|[nuµm])(?:s|sec|seconds?)\s*[\])]?$"
)
_SINCE_1970 = ((1e17, 1), (1e14, 1_000), (1e11, 1_000_000))  # more than this many: ns of the unit
_NUMBER = re.compile(r"[+-]?(\d+)([.,]\d*)?(e[+-]?\d+)?", re.IGNORECASE)
_DATE_KINDS = (
    (re.compile(r"\d{4}([-/.])\d\d?\1\d\d?[ T]\d"), "date"),
    (re.compile(r"\d\d?\.\d\d?\.\d{4} \d"), "date"),
    (re.compile(r"\d\d?:\d\d:\d\d([.,]\d+)?$"), "clock"),
    (re.compile(r"[+-]?\d+([.,]\d*)?(e[+-]?\d+)?$", re.IGNORECASE), "number"),
)
_ZONE = re.compile(r"(Z|[+-]\d\d(:?\d\d)?)$", re.IGNORECASE)
_HEADER_LINES = 100  # of the file, among which the header is
_ROWS = 200  # behind the header, by which ids and channels are judged


@dataclass(frozen=True, slots=True)
class Header:
    """The header of such a file: where it ``begins`` and ends in the head, and its names."""

    begin: int
    end: int
    names: tuple[str, ...]
    separator: str

    def roles(self) -> list[int]:
        """The role of each column; of several lengths the one that is no code counts."""
        roles = [_role(name) for name in self.names]
        lengths = [k for k, role in enumerate(roles) if role == LENGTH]
        for k in lengths[1:] if len(lengths) > 1 else ():
            code = _plain(self.names[lengths[0]]) == "dlc"
            roles[lengths[0] if code else k] = SKIP
        for once in (TIME, ID, DATA, CHANNEL, IS_SENT):
            for k in [k for k, role in enumerate(roles) if role == once][1:]:
                roles[k] = SKIP
        return roles

    def holds_frames(self) -> bool:
        """Whether it names time, id and data."""
        roles = self.roles()
        return TIME in roles and ID in roles and (DATA in roles or roles.count(BYTE) > 1)

    def decimal(self, role: int) -> bool:
        """Whether the name of the columns of this ``role`` says that their numbers are decimal."""
        used = zip(self.names, self.roles(), strict=True)
        named = (name.lower() for name, given in used if given == role)
        marks = (r"(?<![a-z])dec", r"iddec", r"^can\.id$")  # the last of tshark
        return any(re.search("|".join(marks), name) for name in named)

    def unit_ns(self) -> int:
        """ns of the unit that the column of times states; 0 without one."""
        stated = next((n for n in self.names if _role(n) == TIME), "").lower().replace("μ", "µ")
        if unit := _STATED.search(stated):
            return _UNITS_NS[unit[1] if unit[1] in _UNITS_NS else "n"]
        return 1_000_000_000 if re.search(r"[\[(_]\s*s(ec(onds?)?)?\s*[\])]?$", stated) else 0


def _plain(name: str) -> str:
    return re.sub(r"\(.*?\)|\[[a-zµμ�]*\]|[^a-z0-9]", "", name.lower())


def _role(name: str) -> int:
    plain = _plain(name)
    return next((r for r, named in _NAMED.items() if re.fullmatch(named, plain)), SKIP)


def _text(line: bytes) -> str:
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def headers(head: bytes) -> Iterator[Header]:
    """The first lines of a file as headers, wherever they may be one."""
    begin = 0
    for line in head.split(b"\n")[:_HEADER_LINES]:
        end = begin + len(line) + 1
        text = _text(line).strip()
        separator = max(",;\t|", key=text.count)
        if text.count(separator) >= 2:
            names = tuple(name.strip().strip('"') for name in text.split(separator))
            yield Header(begin, end, names, separator)
        begin = end


def header_of(source: LogSource, wanted: Callable[[Header], bool]) -> Header:
    """The first ``wanted`` header of a file.  Raises ClutchestError where there is none: what only
    looked like one may be cut where a format looked, or have more of another separator."""
    for header in headers(source.head):
        if wanted(header):
            return header
    raise ClutchestError(f"{source.path}: expected one line that names time, id and data bytes")


@dataclass(frozen=True, slots=True)
class FirstRows:
    """Cells of the first rows behind a header, by the role of their column."""

    cells: dict[int, list[str]]

    @classmethod
    def of(cls, head: bytes, header: Header) -> FirstRows:
        """Those of the ``head`` of a file; its last line may be cut and is left out."""
        cells: dict[int, list[str]] = {}
        roles = header.roles()
        for line in head[header.end :].split(b"\n", _ROWS)[:_ROWS]:
            given = _text(line.strip(b"\r")).split(header.separator)
            for role, cell in zip(roles, given, strict=False):
                if text := cell.strip().strip('"').strip():
                    cells.setdefault(role, []).append(text)
        return cls(cells)

    def time_kind(self) -> tuple[str, bool]:
        """(``number``, ``date``, ``clock``, or the first cell where it is none of them; whether a
        date has a zone)."""
        first = ""
        for cell in self.cells.get(TIME, ()):
            kind = next((kind for pattern, kind in _DATE_KINDS if pattern.match(cell)), "")
            if kind:
                return kind, bool(_ZONE.search(cell))
            first = first or cell
        return first or "number", False

    def unit_ns(self) -> int:
        """ns of the unit of times: as no log lasts for millennia, large ones are since 1970."""
        cells = self.cells.get(TIME, ())
        value = next((abs(float(c.replace(",", "."))) for c in cells if _NUMBER.fullmatch(c)), 0.0)
        return next((ns for least, ns in _SINCE_1970 if value > least), 1_000_000_000)

    def decimal_ids(self) -> bool:
        """Whether the ids can only be decimal: none has a letter, and one would be no id if it were
        hexadecimal: too large, or of four digits, which an id of 11 bits does not have."""
        ids = self.cells.get(ID, ())
        if not ids or not all(cell.isdecimal() for cell in ids):
            return False
        return any(
            int(cell, 16) > 0x1FFFFFFF or (len(cell) == 4 and 1000 <= int(cell) <= 0x7FF)
            for cell in ids
        )

    def first_channel(self) -> int:
        """The number that the first channel has: 0 where one has it, else 1."""
        found = (re.search(r"\d+", cell) for cell in self.cells.get(CHANNEL, ()))
        return 0 if any(number and int(number[0]) == 0 for number in found) else 1
