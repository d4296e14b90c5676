"""The blocks of an MDF4 file that describe its content: that their links lead to an end.

A chain of groups, channels or conversions that returns to itself would be followed for ever, and
one that many others lead to as often as there are ways to it.  Links count as asammdf follows them:
those of groups also where the block at their end is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from struct import Struct, error
from typing import IO

from clutchest.budgets import MF4_BLOCKS
from clutchest.errors import ClutchestError

_HEADER = Struct("<4s4xQQ")  # id, length, number of links
_START = 64  # the place of the first block
# Links that lead on, by block; others lead back (a default axis, a scope) or to mere text.
_ONWARD = {
    b"##HD": (0, 1, 2, 3, 4),
    b"##DG": (0, 1, 2),
    b"##CG": (0, 1, 2, 3, 4),
    b"##CN": (0, 1, 2, 3, 4, 5, 6),
    b"##CC": (0, 1, 2, 3),
    b"##SI": (0, 1, 2),
    b"##FH": (0, 1),
    b"##AT": (0, 1, 2, 3),
    b"##CH": (0, 1, 2, 3),
    b"##EV": (0,),
    b"##SR": (0, 1),
    b"##DL": (0,),
    b"##LD": (0,),
    b"##HL": (0,),
    b"##CA": (0,),
}
_MOST_LINKS = 1 << 20  # of one block
# Links whose end is taken for a group, whatever is there: (block, number of the link) → block.
_GROUPS = {
    (b"##HD", 0): b"##DG",
    (b"##DG", 0): b"##DG",
    (b"##DG", 1): b"##CG",
    (b"##CG", 0): b"##CG",
}
_ONCE = (b"##CC", b"##SI")  # read once by place, unless other conversions lead there

_Place = tuple[int, bytes]  # of a block, and what it is taken for; empty: what it says


@dataclass(frozen=True, slots=True)
class _Block:
    kind: bytes
    links: list[_Place]


def check_links(path: Path, file: IO[bytes]) -> None:
    """Raises ClutchestError for a chain that returns to itself, or for too many blocks; leaves
    ``file`` at its start."""
    try:
        place = returning(file)
    except OverflowError:
        raise ClutchestError(f"{path}: more than {MF4_BLOCKS} blocks describe its frames") from None
    if place is not None:
        raise ClutchestError(
            f"{path}: the file is damaged: the chain of blocks at {place:#x} returns to itself"
        )
    file.seek(0)


def returning(file: IO[bytes]) -> int | None:
    """The place of a block whose links lead back to itself; None where there is none, or the file
    ends before.

    Raises OverflowError where more than ``MF4_BLOCKS`` blocks would be read, each as often as it is
    reached.
    """
    first = (_START, b"")
    onto = {first}  # the way from the first block
    read: dict[_Place, int] = {}  # how many blocks are read from there
    way = [(first, block := _block(file, first), iter(block.links))]
    kinds: dict[_Place, bytes] = {}
    links = 0
    while way:
        place, block, left = way[-1]
        following = next(left, None)
        if following is None:
            way.pop()
            onto.discard(place)
            once = block.kind != b"##CC"
            read[place] = 1 + sum(
                1 if once and kinds[link] in _ONCE else read[link] for link in block.links
            )
            kinds[place] = block.kind
            if read[place] > MF4_BLOCKS:
                raise OverflowError
        elif following in onto:
            return following[0]
        elif following not in read:
            block = _block(file, following)
            links += len(block.links)
            if links > MF4_BLOCKS:
                raise OverflowError
            onto.add(following)
            way.append((following, block, iter(block.links)))
    return None


def _block(file: IO[bytes], at: _Place) -> _Block:
    """What is at a place, with the places that it leads on to."""
    place, taken_for = at
    try:
        file.seek(place)
        kind, length, count = _HEADER.unpack(file.read(_HEADER.size))
    except (error, OSError, ValueError, OverflowError):  # behind the end
        return _Block(b"", [])
    kind = taken_for or kind
    if kind not in _ONWARD:
        return _Block(kind, [])
    onward: Sequence[int] = _ONWARD[kind]
    if kind == b"##CC":  # conversions of conversions
        onward = range(min(count, _MOST_LINKS, length // 8))
    raw = file.read(8 * (max(onward, default=-1) + 1))
    places = [int.from_bytes(raw[8 * k : 8 * k + 8], "little") for k in onward]
    return _Block(
        kind, [(p, _GROUPS.get((kind, k), b"")) for k, p in zip(onward, places, strict=True) if p]
    )
