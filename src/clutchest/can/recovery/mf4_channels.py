"""Channels of a group in an MDF4 file, some records at a time, as asammdf reads them: only those
that lie within their records, and without running what the file says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clutchest.can.recovery.mf4_conversions import FORMULA, LAST_NUMERIC

if TYPE_CHECKING:
    from asammdf import MDF

OPTIONS: dict[str, Any] = {"process_bus_logging": False}  # which reads the whole file first
TOGETHER = 1 << 21  # bytes of a group's records
LONGEST = 1 << 16  # bytes of one record
_ALL_INVALID, _MAY_BE_INVALID = 1, 2  # cn_flags


@dataclass(frozen=True, slots=True)
class Records:
    """Some records of a group: ``times`` (n,) s, ``samples`` (n, …) as they are stored by the
    channels' numbers, ``invalid`` (n,) by number where there are invalid ones, of times too."""

    times: NDArray[Any]
    samples: Mapping[int, NDArray[Any]]
    invalid: Mapping[int, NDArray[np.bool_]]


def read_channels(
    mdf: MDF, number: int, places: Sequence[int], also: Sequence[int] = ()
) -> Iterator[Records]:
    """The channels at ``places`` of group ``number``, with what is invalid of them, of their times
    and of those at the places ``also``.

    As asammdf's own bus logging does it: its public functions read a group as a whole.  Raises
    ValueError for records that are too long, a channel beyond their end, and no times or some by a
    formula; and whatever asammdf raises.
    """
    inner: Any = mdf._mdf
    group = inner.groups[number]
    if number not in inner.masters_db:
        raise ValueError("its group has no times")
    master = inner.masters_db[number]
    looked_at = [master, *also, *places]
    check_within(group, [group.channels[place] for place in (master, *places)])
    times = group.channels[master].conversion
    if times is not None and (
        times.conversion_type == FORMULA or times.conversion_type > LAST_NUMERIC
    ):
        raise ValueError("its times are told by a formula or a text")
    mdf.configure(read_fragment_size=TOGETHER)
    try:
        for records in inner._load_data(group):
            inner._set_temporary_master(None)  # it keeps the times of what was read before
            now = inner.get_master(number, data=records)
            inner._set_temporary_master(now)
            samples = {
                place: inner.get(
                    group=number,
                    index=place,
                    data=records,
                    samples_only=True,
                    raw=True,
                    ignore_invalidation_bits=True,
                )[0]
                for place in places
            }
            masks = {place: _invalid(group, group.channels[place], records) for place in looked_at}
            invalid = {place: mask for place, mask in masks.items() if mask is not None}
            yield Records(now, samples, invalid)
    finally:
        inner._set_temporary_master(None)


def check_within(group: Any, channels: Sequence[Any]) -> None:
    """Raise ValueError for records that no frame or number needs, and for channels beyond their
    end: asammdf would make room for the one and read there for the other."""
    size, extra = group.channel_group.samples_byte_nr, group.channel_group.invalidation_bytes_nr
    if size + extra > LONGEST:
        raise ValueError(f"records of {size} bytes")
    for channel in channels:
        if 8 * (size - channel.byte_offset) < channel.bit_offset + channel.bit_count:
            raise ValueError(f"{channel.name} ends beyond its records of {size} bytes")


def _invalid(group: Any, channel: Any, records: Any) -> NDArray[np.bool_] | None:
    """In which records (n,) a channel is invalid, by its bit or all of it (ASAM MDF 4, cn_flags);
    None where it has neither."""
    n = records.record_count
    size, extra = group.channel_group.samples_byte_nr, group.channel_group.invalidation_bytes_nr
    if channel.flags & _ALL_INVALID:
        return np.ones(n, bool)
    place, bit = divmod(channel.pos_invalidation_bit, 8)
    if not channel.flags & _MAY_BE_INVALID or place >= extra:
        return None
    if records.invalidation_data is not None:
        bits = np.frombuffer(records.invalidation_data, np.uint8).reshape(n, extra)
    else:
        bits = np.frombuffer(records.data, np.uint8).reshape(n, size + extra)[:, size:]
    return (bits[:, place] >> bit & 1) != 0
