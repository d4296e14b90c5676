"""An MDF4 file that ends early or contradicts itself, made into one that states what it holds.

A logger that loses power leaves its last data block half written, and counts and links to data
that were never written.  Here the blocks of data are followed (ASAM MDF 4.1, 4.2.1: names of blocks
and fields as there), complete blocks are linked anew, and asammdf reads the result.
"""

from __future__ import annotations

import shutil
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from tempfile import TemporaryFile
from typing import IO

import numpy as np
from numpy.typing import NDArray

from clutchest.can.text_scan import compiled

_HEAD = struct.Struct("<4s4xQQ")  # id_block, length, link_count
_ZIPPED = struct.Struct(
    "<2sBxIQQ"
)  # dz_org_block_type, dz_zip_type, parameter, org and data length
_GROUP = struct.Struct("<QQH6xII")  # cg_record_id, cycle_count, flags, data_bytes, inval_bytes
_UNFINISHED = 60  # where id_unfin_flags stand
_LAST_DT, _REPAIRED = 4, 4 | 16  # flags: the last DT has no length yet; nor is the last DL complete
_VLSD = 1  # flag of a group: each record has a length of its own
_PORTION = 16 << 20  # bytes processed together; no DZ block may hold more


@dataclass(frozen=True, slots=True)
class _Part:
    """A block of data at ``at``: ``size`` bytes of records, ``stated`` as many as it should have;
    ``zipped``: deflated in the file."""

    at: int
    size: int
    stated: int
    zipped: bool


@dataclass(frozen=True, slots=True)
class _Channels:
    """A channel group: its records' number, how many it states and at which place, their length
    in bytes (−1: each its own); ``at`` the block, ``carriers`` those of the groups in which what
    is of variable length follows (VLSD)."""

    at: int
    carriers: frozenset[int]
    stated_at: int
    record: int
    cycles: int
    length: int


@dataclass
class Repaired:
    """``file`` is a copy that can be read; ``lost`` how many of the stated records are missing, 0
    where the file states no number."""

    file: IO[bytes]
    lost: int


@dataclass
class _Repair:
    file: IO[bytes]
    size: int
    unfinished: int
    patches: dict[int, bytes] = field(default_factory=dict)
    tail: list[bytes] = field(default_factory=list)
    lost: int = 0

    def at(self, place: int, count: int) -> bytes:
        """Bytes of the file, as far as there are any."""
        self.file.seek(place)
        return self.file.read(max(min(count, self.size - place), 0))

    def block(self, at: int) -> tuple[bytes, int, list[int]] | None:
        """Name, length and links of a block; None where they are not wholly there."""
        head = self.at(at, _HEAD.size)
        if at <= 0 or len(head) < _HEAD.size:
            return None
        name, length, count = _HEAD.unpack(head)
        if not name.startswith(b"##") or count > length // 8:
            return None
        links = self.at(at + _HEAD.size, 8 * count)
        if len(links) < 8 * count:
            return None
        return name, length, list(struct.unpack(f"<{count}Q", links))

    def chain(self, at: int) -> Iterator[tuple[int, list[int]]]:
        """Place and links of the blocks whose first link leads to the next."""
        seen: set[int] = set()
        while at and at not in seen and (block := self.block(at)):
            seen.add(at)
            links = block[2]
            yield at, links
            at = links[0] if links else 0

    def add(self, block: bytes) -> int:
        """Put a block behind the file's end; its place."""
        place = -(-self.size // 8) * 8 + sum(map(len, self.tail))
        self.tail.append(block + bytes(-len(block) % 8))
        return place

    # --- data of one group ---------------------------------------------------------------------

    def parts(self, at: int) -> tuple[list[_Part], bool]:
        """The blocks of data that ``at`` leads to, and whether all of them are whole."""
        if not at:
            return [], True
        block = self.block(at)
        if block is None:
            return [], False
        name, _, links = block
        if name == b"##HL":
            return self.parts(links[0]) if links and links[0] != at else ([], False)
        if name != b"##DL":
            part = self.part(at, last=True)
            return ([part], part.size == part.stated) if part else ([], False)
        parts: list[_Part] = []
        seen: set[int] = set()
        following = at
        for place, list_links in self.chain(at):
            following = list_links[0]
            for link in list_links[1:]:
                part = None if link in seen else self.part(link, last=not following)
                seen.add(link)
                if part is None:
                    return parts, False
                parts.append(part)
                if part.size < part.stated:
                    return parts, False
            if following == place:
                break
        return parts, not following

    def part(self, at: int, last: bool) -> _Part | None:
        """What a DT or DZ block holds; None where it is not there or of another kind."""
        block = self.block(at)
        if block is None:
            return None
        name, length, links = block
        room = self.size - at - _HEAD.size
        if name == b"##DT" and not links:
            stated = length - _HEAD.size
            if last and self.unfinished & _LAST_DT:
                stated = max(stated, room)  # up to the end of the file
            return _Part(at, min(stated, room), stated, False) if stated >= 0 else None
        if name == b"##DZ" and room >= _ZIPPED.size:
            _, transposed, _, whole, packed = _ZIPPED.unpack(self.at(at + _HEAD.size, _ZIPPED.size))
            if whole > _PORTION:
                return None
            if packed <= room - _ZIPPED.size or transposed:  # only the first columns could be read
                held = whole if packed <= room - _ZIPPED.size else 0
                return _Part(at, held, whole, True)
            return _Part(at, len(self.inflated(at, whole)), whole, True)
        return None

    def inflated(self, at: int, whole: int) -> bytes:
        """What a DZ block holds, as far as it can be inflated."""
        start = at + _HEAD.size + _ZIPPED.size
        _, transposed, columns, _, packed = _ZIPPED.unpack(self.at(at + _HEAD.size, _ZIPPED.size))
        try:
            content = zlib.decompressobj().decompress(
                self.at(start, min(packed, self.size - start)), min(whole, _PORTION)
            )
        except zlib.error:
            return b""
        if transposed and columns and len(content) == whole:
            table = np.frombuffer(content[: whole // columns * columns], np.uint8)
            content = table.reshape(columns, -1).T.tobytes() + content[table.size :]
        return content

    def content(self, parts: list[_Part]) -> Iterator[bytes]:
        """The records, a portion at a time."""
        for part in parts:
            if part.zipped:
                yield self.inflated(part.at, part.stated)[: part.size]
            else:
                begin = part.at + _HEAD.size
                for place in range(begin, begin + part.size, _PORTION):
                    yield self.at(place, min(_PORTION, begin + part.size - place))

    def repair_group(self, group: int, links: list[int]) -> None:
        """Make a data group state whole records only."""
        (id_size,) = self.at(group + _HEAD.size + 8 * len(links), 1) or b"\0"
        groups = (self.channels(at, of) for at, of in self.chain(links[1]))
        channels = [channel for channel in groups if channel is not None]
        parts, sound = self.parts(links[2])
        held = sum(part.size for part in parts)
        # asammdf makes room for as many records as are stated
        true = all(one.cycles * max(one.length, 1) <= held for one in channels)
        if not channels or (sound and true and not self.unfinished & _LAST_DT):
            return
        whole, counts = self.whole_records(parts, id_size, channels)
        if sound and true and whole == held:
            return
        self.link(group + _HEAD.size + 16, parts, whole)
        for one, count in zip(channels, counts, strict=True):
            self.patches[one.stated_at] = struct.pack("<Q", count)
            if one.length >= 0:
                self.lost += max(one.cycles - count, 0)

    def channels(self, at: int, links: list[int]) -> _Channels | None:
        """The contents of a CG block."""
        body = at + _HEAD.size + 8 * len(links)
        given = self.at(body, _GROUP.size)
        if len(given) < _GROUP.size:
            return None
        record, cycles, flags, data, invalid = _GROUP.unpack(given)
        length = -1 if flags & _VLSD else data + invalid
        return _Channels(at, self.carriers(links[1]), body + 8, record, cycles, length)

    def carriers(self, at: int) -> frozenset[int]:
        """Places of the data of variable length, of the channels from ``at`` on."""
        places, waiting, seen = set(), [at], {0}
        while waiting:
            for place, links in self.chain(waiting.pop()):
                if place in seen:
                    break
                seen.add(place)
                waiting += links[1:2]  # what a channel is composed of
                places.update(links[5:6])
        return frozenset(places)

    def whole_records(
        self, parts: list[_Part], id_size: int, channels: list[_Channels]
    ) -> tuple[int, NDArray[np.int64]]:
        """How many bytes of the ``parts`` are whole records, and how many records of each group."""
        counts = np.zeros(len(channels), np.int64)
        if not id_size:
            length = channels[0].length
            if length > 0:
                counts[0] = sum(part.size for part in parts) // length
            return int(counts[0]) * max(length, 0), counts
        ids = np.array([one.record for one in channels], np.uint64)
        lengths = np.array([one.length for one in channels], np.int64)
        pairs = np.array(
            [
                (i, k)
                for i, one in enumerate(channels)
                for k, other in enumerate(channels)
                if other.at in one.carriers
            ],
            np.int64,
        ).reshape(-1, 2)
        whole, rest = 0, b""
        for portion in self.content(parts):
            given = rest + portion
            end = _records(np.frombuffer(given, np.uint8), id_size, ids, lengths, pairs, counts)
            whole += end
            rest = given[end:]
            if len(rest) > _PORTION:  # no record is that long: its number is none
                break
        return whole, counts

    def link(self, place: int, parts: list[_Part], whole: int) -> None:
        """Let the link at ``place`` lead to the first ``whole`` bytes of the ``parts``."""
        begins, blocks = 0, []
        for part in parts:
            left = min(whole - begins, part.size)
            if left <= 0:
                break
            at = part.at
            if left < part.stated or self.unfinished & _LAST_DT:
                if part.zipped:
                    content = self.inflated(part.at, part.stated)[:left]
                    at = self.add(_HEAD.pack(b"##DT", _HEAD.size + left, 0) + content)
                else:
                    self.patches[part.at + 8] = struct.pack("<Q", _HEAD.size + left)
            blocks.append((at, begins))
            begins += left
        if len(blocks) > 1:
            n = len(blocks)
            body = struct.pack(
                f"<Q{n}QB3xI{n}Q",
                0,
                *(at for at, _ in blocks),
                0,
                n,
                *(begin for _, begin in blocks),
            )
            blocks = [(self.add(_HEAD.pack(b"##DL", _HEAD.size + len(body), n + 1) + body), 0)]
        self.patches[place] = struct.pack("<Q", blocks[0][0] if blocks else 0)

    def copy(self) -> IO[bytes]:
        """The repaired file."""
        copied = TemporaryFile()  # noqa: SIM115, its reader closes it
        self.file.seek(0)
        shutil.copyfileobj(self.file, copied, 1 << 20)
        copied.write(bytes(-self.size % 8))
        copied.writelines(self.tail)
        flags = struct.pack("<H", self.unfinished & ~_REPAIRED)
        for place, given in {**self.patches, _UNFINISHED: flags}.items():
            copied.seek(place)
            copied.write(given)
        copied.seek(0)
        return copied


def described(file: IO[bytes]) -> bool:
    """Whether an MDF4 file contains the description of its data: some writers put it at the end."""
    size = file.seek(0, 2)
    header = _Repair(file, size, 0).block(64)
    return header is None or not header[2] or header[2][0] + _HEAD.size <= size


def repaired(file: IO[bytes]) -> Repaired | None:
    """``file``, opened, as one that states what it holds; None where it needs no repair.

    The copy is made on disk.
    """
    size = file.seek(0, 2)
    repair = _Repair(file, size, 0)
    header = repair.block(64)
    (repair.unfinished,) = struct.unpack("<H", repair.at(_UNFINISHED, 2).ljust(2, b"\0"))
    if header is None or not header[2]:
        return None
    for group, links in repair.chain(header[2][0]):
        if len(links) >= 3:
            repair.repair_group(group, links)
    return Repaired(repair.copy(), repair.lost) if repair.patches else None


@compiled
def _record(
    data: NDArray[np.uint8],
    i: int,
    id_size: int,
    ids: NDArray[np.uint64],
    lengths: NDArray[np.int64],
) -> tuple[int, int]:
    """The group of the record at ``i``, and its end; −1 where there is no whole one."""
    if i + id_size > len(data):
        return -1, i
    number, group = np.uint64(0), -1
    for byte in range(id_size):
        number |= np.uint64(data[i + byte]) << np.uint64(8 * byte)
    for k in range(len(ids)):
        if ids[k] == number:
            group = k
    if group < 0:
        return -1, i
    end = i + id_size + lengths[group]
    if lengths[group] < 0:
        if i + id_size + 4 > len(data):
            return -1, i
        end = i + id_size + 4
        for byte in range(4):
            end += np.int64(data[i + id_size + byte]) << np.int64(8 * byte)
    return (group, end) if end <= len(data) else (-1, i)


@compiled
def _records(
    data: NDArray[np.uint8],
    id_size: int,
    ids: NDArray[np.uint64],
    lengths: NDArray[np.int64],
    pairs: NDArray[np.int64],
    counts: NDArray[np.int64],
) -> int:
    """Counts the whole records by group; the place behind the last of them.

    A record is whole with its pair: what of it is of variable length, as a record of its own.
    """
    whole, unpaired = 0, 0
    group, i = _record(data, 0, id_size, ids, lengths)
    while group >= 0:
        for pair in range(len(pairs)):
            unpaired += (pairs[pair, 0] == group) - (pairs[pair, 1] == group)
        counts[group] += 1
        if unpaired == 0:
            whole = i
        group, i = _record(data, i, id_size, ids, lengths)
    group, i = _record(data, whole, id_size, ids, lengths)
    while group >= 0:  # those that wait for their pair
        counts[group] -= 1
        group, i = _record(data, i, id_size, ids, lengths)
    return whole
