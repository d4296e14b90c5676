"""SAE J1939: parameter groups of 29-bit ids, and the code ranges that are not values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clutchest.signals import Why

_STANDARD = frozenset((0xF0, 0xFD, 0xFE))  # PDU formats of groups that SAE has assigned
_MOST = 0.8  # of a database's 29-bit ids
_PDU1 = 0x3FF0000  # data pages and PDU format; the next byte is a destination address
_PDU2 = 0x3FFFF00  # …where the format is 240 or more it belongs to the group's number

# Parameters with limits of their own: SPN → what :func:`code_limits` gives.
_OWN_LIMITS = {
    523: (0xFC, 0xFE, 0xFF),  # current gear: 0xFB is "park"
    524: (0xFC, 0xFE, 0xFF),  # selected gear: likewise
    899: (0xF, 0xF, 0xF),  # engine torque mode: 0xE is "other"
    4154: (0x8, 0x8, 0x8),  # fraction of the actual torque: 0.000 … 0.875 %, then not available
}


def pgn_mask(can_id: int) -> int:
    """The bits of a 29-bit id that must agree for the same parameter group."""
    return _PDU1 if (can_id >> 16) & 0xFF < 240 else _PDU2


def pgn(can_id: int) -> int:
    """Parameter group number of a 29-bit id: priority, addresses left out."""
    return (can_id & pgn_mask(can_id)) >> 8


def fits(can_ids: Sequence[int]) -> bool:
    """Whether these 29-bit ids are those of a J1939 database: nearly all are broadcast groups, and
    some in the formats of the standard's own (engine, transmission, vehicle; data page 0)."""
    formats = [can_id >> 16 & 0x3FF for can_id in set(can_ids)]
    broadcast = [form for form in formats if form & 0xFF >= 240]
    return len(broadcast) >= _MOST * len(formats) and not _STANDARD.isdisjoint(formats)


def with_source(can_id: int, source_address: int) -> int:
    """The id as the node ``source_address`` sends it."""
    return (can_id & ~0xFF) | source_address


def code_limits(width: int, spn: int | None = None) -> tuple[int, int, int]:
    """(first reserved, first error, first not-available) raw value of an unsigned parameter.

    Everything from the first reserved value upwards is no value.  ``width`` in bits; a single bit
    has no codes.  Where the three limits agree there are no codes of the kinds before.
    Source: SAE J1939-71, transmitted signal ranges.
    """
    if spn in _OWN_LIMITS:
        return _OWN_LIMITS[spn]
    full = 1 << width
    if width == 1:
        return full, full, full
    if width in (8, 16, 32):
        unit = full >> 8  # the code is in the top byte
        return 0xFB * unit, 0xFE * unit, 0xFF * unit
    return full - 2, full - 2, full - 1


def why_of(raw: NDArray[np.uint64], width: int, spn: int | None = None) -> NDArray[np.uint8]:
    """Codes of :class:`Why`, shape (n,), for raw values (n,) of an unsigned parameter."""
    reserved, error, absent = code_limits(width, spn)
    why = np.full(len(raw), Why.VALID, np.uint8)
    if reserved >> width:
        return why
    why[raw >= np.uint64(reserved)] = Why.RESERVED
    why[raw >= np.uint64(error)] = Why.ERROR
    why[raw >= np.uint64(absent)] = Why.NOT_AVAILABLE
    return why
