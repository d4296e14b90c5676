"""MDF4 bus logging: the groups of CAN data, remote and error frames, read as columns."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from datetime import UTC, datetime
from io import BytesIO, StringIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clutchest.budgets import UNPACKED_BYTES
from clutchest.can.frames import LENGTHS, Flag, Frames
from clutchest.can.log_format import LogFormat, begins_with
from clutchest.can.log_source import LogSource, quiet
from clutchest.can.recovery.half_read import opened
from clutchest.can.recovery.mf4_channels import OPTIONS, read_channels
from clutchest.can.recovery.mf4_conversions import physical
from clutchest.can.time_stamps import LAST_S
from clutchest.errors import ClutchestError
from clutchest.extras import required

if TYPE_CHECKING:
    from asammdf import MDF, Signal

_EPOCH_S = 1e8  # an earlier start of the measurement is no date
_CHANNELS = (
    "BusChannel",
    "ID",
    "IDE",
    "DLC",
    "DataLength",
    "DataBytes",
    "Dir",
    "EDL",
    "BRS",
    "ESI",
)
_FLAGS = {"EDL": Flag.FD, "BRS": Flag.BITRATE_SWITCH, "ESI": Flag.ERROR_STATE, "Dir": Flag.SENT}
_OPTIONAL = ("BusChannel", *_FLAGS)  # 0 where invalid, and the frame is kept
_KINDS = {"CAN_DataFrame": Flag(0), "CAN_RemoteFrame": Flag.REMOTE, "CAN_ErrorFrame": Flag.ERROR}
_DLC = np.array([*range(9), *np.repeat(range(9, 16), (4, 4, 4, 4, 8, 16, 16))], np.uint8)


def read(source: LogSource) -> Iterator[Frames]:
    """All CAN frames of an MDF4 file, by time.

    One that ends early is repaired as far as possible.
    """
    if source.head[8:9] != b"4":
        raise ClutchestError(f"{source.path}: bus logging needs version 4 of MDF")
    required("asammdf")
    blocks = _blocks(source)
    try:
        while (frames := _next(source, blocks)) is not None:
            yield frames
    finally:
        blocks.close()


def _next(source: LogSource, blocks: Iterator[Frames]) -> Frames | None:
    try:
        with quiet("asammdf"), redirect_stdout(StringIO()):  # it prints its own errors
            return next(blocks, None)
    except ClutchestError:
        raise
    except Exception as error:  # asammdf has no errors of its own
        raise ClutchestError(f"{source.path}: {_damaged(error)}") from None


def _blocks(source: LogSource) -> Generator[Frames, None, None]:
    if source.zipped:
        yield from _of_file(source, BytesIO(source.everything(UNPACKED_BYTES)))
    else:
        with source.path.open("rb") as file:
            yield from _of_file(source, file)


def _of_file(source: LogSource, file: IO[bytes]) -> Iterator[Frames]:
    """The frames that can be read; what is lost is counted."""
    from clutchest.can.recovery import mf4 as recovery
    from clutchest.can.recovery.mf4_links import check_links

    check_links(source.path, file)
    if not recovery.described(file):
        raise ClutchestError(
            f"{source.path}: the file ends early, and with its end what describes "
            "its frames is lost"
        )
    whole = recovery.repaired(file)
    if whole is None:
        file.seek(0)
        # asammdf completes an unfinished file in a copy if it is given a path; a path maps the file
        unfinished = source.head.startswith(b"UnFin")
        yield from _groups(source.path if unfinished and not source.zipped else file)
        return
    span: list[int] = []
    absolute = True
    with whole.file:
        for frames in _groups(whole.file):
            if len(frames):
                span, absolute = [*span[:1], *frames.t_ns[[0, -1]]], frames.absolute
            yield frames
    end = f" behind {(span[-1] - span[0]) / 1e9:.3f} s" if span else ""
    lost = (f"file ends early, frames{end} are lost", max(whole.lost, 1))
    yield Frames.empty(absolute=absolute, rejected=(lost,))


def _groups(file: Any) -> Iterator[Frames]:
    with opened(file, **OPTIONS) as mdf:
        start_s = mdf.header.start_time.timestamp()
        absolute = start_s > _EPOCH_S
        start_ns = round(start_s * 1e6) * 1000 if absolute else 0
        groups: list[Any] = list(mdf.groups)
        parts = [
            _read_group(mdf, index, kind, start_ns, absolute)
            for index, group in enumerate(groups)
            if group.channel_group.cycles_nr
            for kind in _KINDS
            if any(channel.name == kind for channel in group.channels)
        ]
        notes = tuple(_without_bus(groups))
        if notes or not parts:
            yield Frames.empty(absolute=absolute, notes=notes)
        if not parts:
            return
        yield from parts[0] if len(parts) == 1 else _merged(parts)


def _without_bus(groups: Sequence[Any]) -> Iterator[str]:
    """Of kinds of frames whose groups may be those of several buses and do not say of which."""
    for kind in _KINDS:
        names = [
            {c.name for c in group.channels} for group in groups if group.channel_group.cycles_nr
        ]
        bare = sum(kind in present and f"{kind}.BusChannel" not in present for present in names)
        if bare > 1:
            yield f"{bare} groups of {kind} have no BusChannel: all are read as channel 0"


def _merged(parts: Sequence[Iterator[Frames]]) -> Iterator[Frames]:
    """Blocks of several groups, each in order of time, as blocks of all by time."""
    heads = [next(part, None) for part in parts]
    while live := [(k, head) for k, head in enumerate(heads) if head is not None]:
        # later frames of any group are later than this
        until = min((int(head.t_ns.max()) for _, head in live if len(head)), default=0)
        ready = []
        for k, head in live:
            now = head.t_ns <= until
            ready.append(head.take(now))
            left = None if now.all() else replace(head.take(~now), rejected=())
            heads[k] = next(parts[k], None) if left is None else left
        yield Frames.concatenate(ready).sorted()


def _read_group(mdf: MDF, index: int, kind: str, start_ns: int, absolute: bool) -> Iterator[Frames]:
    """The frames of one kind in a group, some at a time; what is damaged behind them is counted."""
    group: Any = mdf.groups[index]
    present = {channel.name: place for place, channel in enumerate(group.channels)}
    named = {name: present[f"{kind}.{name}"] for name in _CHANNELS if f"{kind}.{name}" in present}
    left = group.channel_group.cycles_nr
    try:
        for part in read_channels(mdf, index, list(named.values()), [present[kind]]):
            samples = {name: part.samples[place] for name, place in named.items()}
            if "DataLength" in named:
                conversion = group.channels[named["DataLength"]].conversion
                length, known = physical(samples["DataLength"], conversion)
                samples["DataLength"] = length if known.all() else np.where(known, length, -1)
            invalid = np.zeros(len(part.times), bool)
            names = {place: name for name, place in named.items()}
            for place, mask in part.invalid.items():
                name = names.get(place, "")
                if name in _OPTIONAL:
                    samples[name] = np.where(mask, np.zeros(1, samples[name].dtype), samples[name])
                else:
                    invalid |= mask
            frames = _frames(kind, part.times, samples, invalid, start_ns, absolute)
            left -= len(part.times)
            yield frames
    except Exception as error:  # asammdf has no errors of its own
        yield Frames.empty(absolute=absolute, rejected=((_damaged(error), max(left, 1)),))


def _damaged(error: Exception) -> str:
    """asammdf's message in one line, whatever the file has put into it."""
    return f"the file is damaged ({type(error).__name__}: {' '.join(str(error).split())})"


def _lengths(samples: Mapping[str, NDArray], is_fd: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Payload bytes (n,) from what a group has; −1 where that is no number."""
    if "DataLength" not in samples:
        if "DLC" not in samples:
            return np.zeros(len(is_fd), np.int64)
        length = LENGTHS[np.minimum(samples["DLC"].astype(np.int64), 15)]
        return np.where(is_fd, length, np.minimum(length, 8))
    given = samples["DataLength"]
    if given.dtype.kind == "f":
        given = np.where(np.isfinite(given), given, -1)
    length = given.astype(np.int64)
    if "DLC" in samples and np.any(length > 8):
        # there the length is never the code, so what is equal to it is one
        coded = is_fd & (length > 8) & (length < 16) & (length == samples["DLC"])
        length[coded] = LENGTHS[length[coded]]
    return length


def _frames(
    kind: str,
    times: NDArray,
    samples: Mapping[str, NDArray],
    invalid: NDArray[np.bool_],
    start_ns: int,
    absolute: bool,
) -> Frames:
    """Frames of one kind from the channels that their group has, less ``invalid`` ones (n,);
    nothing of these is kept."""
    n = len(times)

    def column(name: str) -> NDArray:
        if name not in samples:
            return np.zeros(n, np.int64)
        if samples[name].dtype.kind == "S":  # some loggers write the direction in words
            return (np.char.lower(samples[name]) == b"tx").astype(np.uint8)
        return samples[name]

    ids = column("ID").astype(np.uint32)
    extended = (column("IDE") != 0) | (ids >> np.uint32(31) != 0)
    if "IDE" not in samples:
        extended |= ids > np.uint32(0x7FF)
    flags = np.full(n, _KINDS[kind], np.uint8)
    if kind != "CAN_ErrorFrame":
        flags[extended] |= np.uint8(Flag.EXTENDED)
    for name, flag in _FLAGS.items():
        flags[column(name) != 0] |= np.uint8(flag)
    length = _lengths(samples, (flags & Flag.FD) != 0)
    payload = column("DataBytes")
    carried = payload.shape[1] if payload.ndim == 2 else 0
    most = 64 if kind == "CAN_RemoteFrame" else min(carried, 64)
    sound = (length >= 0) & (length <= most) & ~invalid
    data = np.zeros((n, 64 if length[sound].max(initial=0) > 8 else 8), np.uint8)
    width = min(carried, data.shape[1])
    data[:, :width] = payload[:, :width] if carried else 0
    data[np.arange(data.shape[1]) >= length[:, None]] = 0
    timed = np.isfinite(times) & (np.abs(times) < LAST_S)
    t_ns = start_ns + np.rint(np.where(timed, times, 0.0) * 1e9).astype(np.int64)
    sound &= timed
    frames = Frames(
        t_ns,
        column("BusChannel").astype(np.uint8),
        ids & np.uint32(0x1FFFFFFF),
        flags,
        length.astype(np.uint8),
        data,
        absolute,
    )
    if sound.all():
        return frames
    counts = {
        "frame is marked as invalid": int(np.count_nonzero(invalid)),
        "frame has no sound length or time": int(np.count_nonzero(~sound & ~invalid)),
    }
    lost = tuple((reason, count) for reason, count in counts.items() if count)
    return replace(frames.take(sound), rejected=lost)


def write(frames: Frames, path: Path) -> None:
    """One group each of data, remote and error frames, as far as there are any."""
    required("asammdf")
    from asammdf import MDF

    start_s = int(frames.t_ns[0] // 10**9) if len(frames) and frames.absolute else 0
    with MDF(version="4.10") as mdf:
        mdf.header.start_time = datetime.fromtimestamp(start_s, UTC)
        for kind, flag in _KINDS.items():
            rows = (frames.flags & (Flag.REMOTE | Flag.ERROR)) == flag
            if rows.any():
                mdf.append(
                    _signal(frames.take(rows).sorted(), kind, start_s),
                    comment="written by clutchest",
                )
        mdf.save(path, overwrite=True, compression=2)


def _signal(frames: Frames, kind: str, start_s: int) -> Signal:
    from asammdf import Signal, Source

    def flag(bit: Flag) -> np.ndarray:
        return ((frames.flags & bit) != 0).astype(np.uint8)

    width = frames.data.shape[1]
    columns: dict[str, np.ndarray] = {
        "BusChannel": frames.channel,
        "ID": frames.id,
        "IDE": flag(Flag.EXTENDED),
        "DLC": _DLC[frames.length],
        "DataLength": frames.length,
        "DataBytes": frames.data,
        "Dir": flag(Flag.SENT),
        "EDL": flag(Flag.FD),
        "BRS": flag(Flag.BITRATE_SWITCH),
        "ESI": flag(Flag.ERROR_STATE),
    }
    layout = [
        (f"{kind}.{name}", column.dtype, (width,) if column.ndim == 2 else ())
        for name, column in columns.items()
    ]
    samples = np.zeros(len(frames), layout)
    for name, column in columns.items():
        samples[f"{kind}.{name}"] = column
    bus = Source(kind, kind, "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    return Signal(samples, (frames.t_ns - start_s * 10**9) / 1e9, name=kind, source=bus)


FORMAT = LogFormat(
    title=".mf4",
    about="ASAM MDF 4 with bus logging, CAN and CAN FD",
    suffix=".mf4",
    sniff=begins_with(b"MDF     ", b"UnFinMF "),
    read=read,
    save=write,
)
