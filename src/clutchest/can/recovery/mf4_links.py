"""The blocks of an MDF4 file that describe its content: that their links lead to an end.

A chain of groups, channels or conversions that returns to itself would be followed for ever.
"""

from __future__ import annotations

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

    Raises OverflowError for more than ``MF4_BLOCKS`` blocks.
    """
    onto: set[int] = set()  # the way from the first block
    done: set[int] = set()
    way: list[tuple[int, list[int]]] = [(_START, _links(file, _START))]
    onto.add(_START)
    while way:
        place, left = way[-1]
        if not left:
            way.pop()
            onto.discard(place)
            done.add(place)
            continue
        following = left.pop()
        if following in onto:
            return following
        if following in done:
            continue
        if len(done) + len(onto) > MF4_BLOCKS:
            raise OverflowError
        onto.add(following)
        way.append((following, _links(file, following)))
    return None


def _links(file: IO[bytes], place: int) -> list[int]:
    """The places that a block leads on to."""
    try:
        file.seek(place)
        kind, length, count = _HEADER.unpack(file.read(_HEADER.size))
    except (error, OSError, ValueError, OverflowError):  # behind the end
        return []
    onward = _ONWARD.get(kind, ())
    if not onward or count > _MOST_LINKS or length < _HEADER.size + 8 * count:
        return []
    raw = file.read(8 * count)
    places = [int.from_bytes(raw[8 * k : 8 * k + 8], "little") for k in range(len(raw) // 8)]
    if kind == b"##CC":  # conversions of conversions
        onward = tuple(range(len(places)))
    return [places[k] for k in onward if k < len(places) and places[k]]
