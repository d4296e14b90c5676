"""TDMS of National Instruments (LabVIEW, DIAdem): groups of channels.

A channel's times are its waveform's (``wf_start_time``, ``wf_increment``), else those of the
channel ``time`` in its group.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clutchest.can.log_source import quiet
from clutchest.extras import required
from clutchest.reading.channel_groups import Group, table_of
from clutchest.reading.signal_table import SignalTable
from clutchest.reading.table_budget import check_cells
from clutchest.reading.table_kind import TableKind

_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")


def read(path: Path) -> SignalTable:
    """The channels that hold numbers or times."""
    required("nptdms")
    from nptdms import TdmsFile

    with quiet("nptdms"), TdmsFile.open(path) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        check_cells(path, sum(len(channel) for channel in channels))
        early = file.file_status.incomplete_final_segment
        notes = ("the file ends early; what is there is used",) if early else ()
        return table_of(str(path), list(_groups(channels, early)), "/", notes)


def _groups(channels: list[Any], early: bool) -> Iterator[Group]:
    """The channels of a group that share their times together; of a file that ends ``early`` the
    last ones are shorter, and all are used as far as the shortest."""
    together: dict[tuple[Any, ...], list[Any]] = {}
    for channel in channels:
        if len(channel) and channel.dtype.kind in "iufbM":
            length = 0 if early else len(channel)
            key = (channel.group_name, length, *_waveform(channel.properties))
            together.setdefault(key, []).append(channel)
    for (*_, increment, offset, start), members in together.items():
        length = min(map(len, members))
        columns = {f"{each.group_name}/{each.name}": each[:][:length] for each in members}
        units = {f"{each.group_name}/{each.name}": _unit(each.properties) for each in members}
        time = None if increment is None else offset + increment * np.arange(length)
        yield Group(columns, units, time, start)


def _waveform(properties: Mapping[str, Any]) -> tuple[float | None, float, int | None]:
    """Step and begin of a channel's times, s, and the epoch time of their zero, ns."""
    increment = properties.get("wf_increment")
    if increment is None or not float(increment) > 0.0:
        return None, 0.0, None
    start = properties.get("wf_start_time")
    known = start is not None and np.datetime64(start, "ns").astype(np.int64) > 0
    since = int(np.datetime64(start, "ns").astype(np.int64)) if known else None
    return float(increment), float(properties.get("wf_start_offset", 0.0)), since


def _unit(properties: Mapping[str, Any]) -> str:
    return next((str(properties[key]) for key in _UNITS if properties.get(key)), "")


FORMAT = TableKind(
    about="TDMS of LabVIEW and DIAdem, with the times of waveforms or of a channel `time`",
    suffixes=(".tdms",),
    marks=(b"TDSm",),
    read=read,
    extra="tdms",
)
