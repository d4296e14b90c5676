"""Vector's binary log: objects in zlib containers, loose, or in containers within containers.

Objects that carry frames: CAN_MESSAGE, CAN_MESSAGE2, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64 and the
error frames CAN_ERROR, CAN_ERROR_EXT, CAN_FD_ERROR_64; all others are passed over.  The layout is
known from T. Lorenz's Vector_BLF and from python-can, there is no published specification.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray as Column

from clutchest.can.frames import LENGTHS, Flag, Frames
from clutchest.can.log_source import BAD_DATA, BLOCK, Bytes, LogSource, zlib
from clutchest.can.text_scan import Table, compiled
from clutchest.can.time_stamps import EPOCH_NS, LAST_S

_HEADER = struct.Struct("<4sL8B2Q2L8H8H")
_OBJECT = struct.Struct("<4s2H2L")  # mark, length of the header, its version, length, type
_CONTAINER = struct.Struct("<16xH14x")  # method; what it claims to hold is not believed
_LARGEST = 16 << 20  # bytes of one object, packed or not; what claims more is damaged
_DEEPEST = 4  # containers within containers
_MOST_NESTED = 64 << 20  # bytes that inner containers may make of one block

_BROKEN = "object is damaged"
_CUT = "file ends early"
_TOO_LARGE = f"container holds more than {_LARGEST >> 20} MiB"
_TOO_DEEP = "containers within containers hold too much"
_METHOD = "container is compressed in an unknown way"

# Types of objects
_MESSAGE, _ERROR, _BOX, _ERROR_EXT, _MESSAGE_2, _FD, _FD_64, _FD_ERROR = (
    1,
    2,
    10,
    73,
    86,
    100,
    101,
    104,
)
_SHORTEST = 40  # bytes of an object that carries a frame
_FRAME, _OTHER, _BAD, _WIDE = range(4)

_IS_EXTENDED, _IS_REMOTE, _IS_ERROR = int(Flag.EXTENDED), int(Flag.REMOTE), int(Flag.ERROR)
_IS_SENT, _IS_FD = int(Flag.SENT), int(Flag.FD)
_HAS_BRS, _HAS_ESI = int(Flag.BITRATE_SWITCH), int(Flag.ERROR_STATE)


def read(source: LogSource) -> Iterator[Frames]:
    """Frames of a blf log; objects that cannot be read are counted in ``rejected``."""
    header = source.read(_HEADER.size)
    if len(header) < _HEADER.size:
        yield Frames.empty(rejected=((_CUT, 1),))
        return
    fields = _HEADER.unpack(header)
    source.read(max(0, min(fields[1], 4096) - _HEADER.size))
    objects = _ObjectReader(_start_ns(fields[14:22]))
    pieces: list[bytes] = []
    held = 0
    for piece in _contents(source, objects.rejected):
        pieces.append(piece)
        held += len(piece)
        if held >= BLOCK:
            yield objects.block(b"".join(pieces))
            pieces, held = [], 0
    if fields[10] > source.position and not objects.rejected[_CUT]:
        objects.rejected[_CUT] += 1
    yield objects.block(b"".join(pieces), last=True)


def _start_ns(date: tuple[int, ...]) -> int:
    """A SYSTEMTIME in ns since 1970, 0 if it is no date."""
    year, month, _, day, hour, minute, second, millisecond = date
    try:
        start = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError:
        return 0
    seconds = int(start.timestamp())
    return (seconds * 1000 + millisecond) * 10**6 if 0 <= seconds < LAST_S else 0


def _contents(source: Bytes, rejected: Counter[str]) -> Iterator[bytes]:
    """What the objects of a file hold, strung together; containers are opened."""
    rest = source.read(_OBJECT.size + 4)
    while rest := _next_object(source, rest, rejected):
        _, _, _, length, kind = _OBJECT.unpack_from(rest)
        body = rest[:length]
        body += source.read(length - len(body))
        if len(body) < length:
            rejected[_CUT] += 1
        yield _unpacked(body, rejected) if kind == _BOX else body
        rest = rest[length:]
        rest += source.read(max(0, _OBJECT.size + 4 - len(rest)))


def _next_object(source: Bytes, rest: bytes, rejected: Counter[str]) -> bytes:
    """What follows, from the next object on; empty at the end.  Objects may be padded by 4."""
    at, lost = 0, False
    while True:
        mark = rest.find(b"LOBJ", at)
        if mark < 0:
            piece = source.read(1 << 12)
            lost |= bool(rest[at:].strip(b"\0")) and len(rest) - at > 3
            rest, at = rest[max(at, len(rest) - 3) :] + piece, 0
            if not piece:
                if rest.strip(b"\0"):
                    rejected[_CUT] += 1
                return b""
            continue
        lost |= mark - at > 4
        if len(rest) - mark < _OBJECT.size:
            rest, at = rest[mark:] + source.read(_OBJECT.size), 0
            if len(rest) < _OBJECT.size:
                rejected[_CUT] += 1
                return b""
            continue
        if _OBJECT.size <= _OBJECT.unpack_from(rest, mark)[3] <= _LARGEST:
            rejected[_BROKEN] += int(lost)
            return rest[mark:]
        at, lost = mark + 1, True


def _unpacked(box: bytes, rejected: Counter[str], largest: int = _LARGEST) -> bytes:
    """What a container holds, as far as it can be unpacked."""
    if len(box) < _CONTAINER.size:
        rejected[_BROKEN] += 1
        return b""
    (method,) = _CONTAINER.unpack_from(box)
    packed = box[_CONTAINER.size :]
    if method == 0:
        return packed
    if method != 2:
        rejected[_METHOD] += 1
        return b""
    inflater = zlib.decompressobj()
    try:
        content = inflater.decompress(packed, largest + 1)
    except BAD_DATA:
        rejected[_BROKEN] += 1
        return _as_far_as_it_goes(packed, largest)
    if len(content) > largest:
        rejected[_TOO_LARGE if largest == _LARGEST else _TOO_DEEP] += 1
        return b""
    if not inflater.eof:
        rejected[_BROKEN] += 1
    return content


def _as_far_as_it_goes(packed: bytes, largest: int) -> bytes:
    """What precedes the damage, in small portions, because an error loses the portion it is in."""
    inflater, parts, left = zlib.decompressobj(), [], largest
    for start in range(0, len(packed), 256):
        try:
            parts.append(inflater.decompress(packed[start : start + 256], left))
        except BAD_DATA:
            break
        left -= len(parts[-1])
        if left <= 0:
            break
    return b"".join(parts)


class _ObjectReader:
    """Reads the objects of a log, block by block."""

    def __init__(self, start_ns: int) -> None:
        self.start_ns = start_ns
        self.rejected: Counter[str] = Counter()
        self.tails = [b""] * (_DEEPEST + 1)  # objects that continue in the next block, by depth
        self.width = 8
        self.nested = 0

    def block(self, content: bytes, last: bool = False) -> Frames:
        """The frames of the next block, with what has been rejected since the one before."""
        self.nested = 0
        parts = self.objects(content, 0)
        if last and any(tail.strip(b"\0") for tail in self.tails) and not self.rejected[_CUT]:
            self.rejected[_CUT] += 1
        frames = Frames.concatenate(parts)
        rejected = tuple((why, n) for why, n in self.rejected.items() if n)
        self.rejected.clear()
        return replace(frames, absolute=self.start_ns >= EPOCH_NS, rejected=rejected)

    def objects(self, content: bytes, depth: int) -> list[Frames]:
        content = self.tails[depth] + content
        data = np.frombuffer(content, np.uint8)
        parts: list[Frames] = []
        at = 0
        while at < len(data):
            state = np.array([at, 0, 0], np.int64)  # position, frames, damaged objects
            table = Table.of((len(data) - at) // _SHORTEST + 1, self.width)
            nested = _scan(data, self.start_ns, table, state)
            if nested == _WIDE:
                self.width = 64
                continue
            n = int(state[1])
            parts.append(table.frames(n))
            self.rejected[_BROKEN] += int(state[2])
            if nested != _BOX:
                at = int(state[0])
                break
            length = int.from_bytes(content[state[0] + 8 : state[0] + 12], "little")
            parts += self.box(content[state[0] : state[0] + length], depth + 1)
            at = int(state[0]) + length
        self.tails[depth] = content[at:]
        return parts

    def box(self, box: bytes, depth: int) -> list[Frames]:
        room = min(_LARGEST, _MOST_NESTED - self.nested)
        if depth > _DEEPEST or room <= 0:
            self.rejected[_TOO_DEEP] += 1
            return []
        content = _unpacked(box, self.rejected, room)
        self.nested += len(content)
        return self.objects(content, depth)


@compiled
def _number(data: Column, i: int, size: int) -> int:
    """The little-endian number of ``size`` bytes at ``i``."""
    value = 0
    for byte in range(size):
        value |= int(data[i + byte]) << (8 * byte)
    return value


@compiled
def _marked(data: Column, i: int) -> bool:
    return bool(data[i] == 76 and data[i + 1] == 79 and data[i + 2] == 66 and data[i + 3] == 74)


@compiled
def _scan(data: Column, start_ns: int, out: Table, state: Column) -> int:
    """Fills the table from the objects from ``state[0]`` on; leaves the place where it stopped.

    Gives _BOX at a container, _WIDE if a payload is wider than the table, else _OTHER: there the
    next object continues in the next block.
    """
    i, n, size, lost = state[0], 0, len(data), False
    ending = _OTHER
    while i + 16 <= size:
        at, last = i, min(i + 5, size - 15)
        while at < last and not _marked(data, at):
            at += 1
        if at == last and size - i < 21:
            break  # it may begin behind the block
        if at == last or not 16 <= _number(data, at + 8, 4) <= _LARGEST:
            state[2] += not lost
            lost = True
            i += 1
            while i + 16 <= size and not _marked(data, i):
                i += 1
            continue
        lost, i = False, at
        length = _number(data, i + 8, 4)
        if i + length > size:
            break
        kind = _number(data, i + 12, 4)
        if kind == _BOX:
            ending = _BOX
            break
        version = _number(data, i + 6, 2)
        body = 32 if version == 1 else 40
        if length >= body + 8 and (version == 1 or version == 2):
            what = _object(data, i, i + body, i + length, kind, n, out)
            if what == _WIDE:
                return _WIDE
            if what == _FRAME:
                t = _number(data, i + 24, 8)
                out.t_ns[n] = start_ns + (t * 10_000 if _number(data, i + 16, 4) == 1 else t)
                n += 1
            elif what == _BAD:
                state[2] += 1
        i += length
    state[0], state[1] = min(i, size), n
    return ending


@compiled
def _object(data: Column, start: int, i: int, end: int, kind: int, n: int, out: Table) -> int:
    """Reads the object at ``start`` with its body at ``i`` into row ``n``; what it was."""
    room = end - i  # of the body, then of the payload
    flag = identifier = stated = count = 0
    channel, first = _number(data, i, 2), i
    if kind in (_MESSAGE, _MESSAGE_2):
        if room < 16:
            return _BAD
        flag = (_IS_SENT if data[i + 2] & 1 else 0) | (_IS_REMOTE if data[i + 2] & 0x80 else 0)
        stated, identifier = _number(data, i + 3, 1), _number(data, i + 4, 4)
        count, first, room = min(stated, 8), i + 8, 8
    elif kind == _FD:
        if room < 20:
            return _BAD
        flag = (_IS_SENT if data[i + 2] & 1 else 0) | (_IS_REMOTE if data[i + 2] & 0x80 else 0)
        modes = data[i + 13]
        flag |= (_IS_FD if modes & 1 else 0) | (_HAS_BRS if modes & 2 else 0)
        flag |= _HAS_ESI if modes & 4 else 0
        stated, identifier = LENGTHS[min(data[i + 3], 15)], _number(data, i + 4, 4)
        count, first, room = _number(data, i + 14, 1), i + 20, min(64, room - 20)
    elif kind == _FD_64:
        if room < 40:
            return _BAD
        modes = _number(data, i + 12, 4)
        flag = (_IS_SENT if data[i + 34] else 0) | (_IS_REMOTE if modes & 0x10 else 0)
        flag |= (_IS_FD if modes & 0x1000 else 0) | (_HAS_BRS if modes & 0x2000 else 0)
        flag |= _HAS_ESI if modes & 0x4000 else 0
        channel, identifier = _number(data, i, 1), _number(data, i + 4, 4)
        stated, count, first = LENGTHS[min(data[i + 1], 15)], _number(data, i + 2, 1), i + 40
        # Behind the payload there may be other data, counted from the start of the object.
        further = _number(data, i + 35, 1)
        room = min(start + further if further else end, end) - first
    elif kind == _ERROR_EXT:
        if room < 32:
            return _BAD
        flag, identifier = _IS_ERROR, _number(data, i + 16, 4) & 0x7FFFFFFF
        count, first, room = min(_number(data, i + 10, 1), 8), i + 24, 8
    elif kind == _ERROR:
        flag = _IS_ERROR
    elif kind == _FD_ERROR:
        flag, channel = _IS_ERROR | _IS_FD, _number(data, i, 1)
    else:
        return _OTHER
    if max(count, stated) > 64:
        return _BAD
    if flag & _IS_REMOTE:
        count, room = stated, 0
    elif count > out.data.shape[1]:
        return _WIDE
    if identifier & 0x80000000:
        flag |= _IS_EXTENDED
    out.channel[n], out.id[n] = max(channel - 1, 0) & 0xFF, identifier & 0x1FFFFFFF
    out.flags[n], out.length[n] = flag, count
    given = max(0, min(count, room))
    for byte in range(given):
        out.data[n, byte] = data[first + byte]
    for byte in range(given, out.data.shape[1]):
        out.data[n, byte] = 0
    return _FRAME
