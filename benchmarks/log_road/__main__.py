"""Logs to signals to estimates: seconds, µs per frame, and ratios formed within one turn.

    python benchmarks/log_road [formats] [others] [parquet] [replay] [hour] [linear] [memory]
        [--json FILE]

    formats   read and decode the mapped signals of the same file: clutchest, python-can with
              cantools (asammdf for mf4), and the least that the bytes cost
    others    what does a part of that, where it is installed: vblf with cantools, can_decoder on
              frames in memory, mf4-rs on raw columns of an MDF that is not compressed
    parquet   a python-can log to Parquet, one file per message, in bounded memory
    replay    the whole replay against python-can, cantools and a filterpy filter
    hour      `clutchest replay` of one hour, five messages at 100 Hz: wall clock and memory
    linear    the whole replay from 10^4 to --most frames
    memory    `clutchest replay` of larger and larger files (--gigabytes)

What is compared runs in turn, --repeats times, so that whatever else the machine does meets all.
Each figure is min / median / max over the turns.  "Canonical signals" is more than the peers do:
units, plausible ranges, senders, counters and checksums, and an account of every frame.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

import cantools
import drives
import limits
import numpy as np
import peers
import pyarrow.parquet as pq
from asammdf import MDF

import clutchest
from clutchest.can.database import Database
from clutchest.can.decode import decode, rows_of
from clutchest.can.files import read_blocks, write_frames
from clutchest.models import machine_of
from clutchest.reading import load_database
from clutchest.reading.wanted import mapped_messages

Times = dict[str, list[float]]


def in_turn(what: dict[str, Callable[[], object]], repeats: int) -> Times:
    """Seconds of each, (repeats,); what compiles has been called once before."""
    times: Times = {name: [] for name in what}
    for _ in range(repeats):
        for name, call in what.items():
            begin = perf_counter()
            call()
            times[name].append(perf_counter() - begin)
    return times


def spread(values: Any) -> dict[str, float]:
    """min, median, max."""
    return {
        "min": float(np.min(values)),
        "median": float(np.median(values)),
        "max": float(np.max(values)),
    }


def told(values: dict[str, float], unit: str = "", scale: float = 1.0) -> str:
    return " / ".join(f"{scale * v:.3g}" for v in values.values()) + f" {unit}"


def against(times: Times, ours: str, n: int, title: str) -> dict[str, Any]:
    """µs per frame of each, and how many times as long as ``ours`` each takes."""
    print(f"\n{title}, {n} frames")
    result: dict[str, Any] = {"frames": n, "us_per_frame": {}, "ratio_to_clutchest": {}}
    for name, seconds in times.items():
        per_frame = spread(np.array(seconds) / n * 1e6)
        ratio = spread(np.array(seconds) / np.array(times[ours]))
        result["us_per_frame"][name], result["ratio_to_clutchest"][name] = per_frame, ratio
        print(f"  {name:28s} {told(per_frame, 'µs/frame'):34s} × {told(ratio)}")
    return result


def read_and_decode(path: Path, vehicle: clutchest.Vehicle, database: Database) -> int:
    """The mapped signals of every block as columns; the number of frames."""
    wanted = mapped_messages(vehicle, database)
    n = 0
    for frames in read_blocks(path):
        n += len(frames)
        for name, layouts in wanted.items():
            message = database.message(name)
            decode(frames, rows_of(frames, message), message, list(layouts))
    return n


class Decoding(NamedTuple):
    """What every way of decoding is given: the ``wanted`` signals of every message by name, and the
    DBC as a file and as it is usually loaded."""

    vehicle: clutchest.Vehicle
    database: Database
    wanted: dict[str, set[str]]
    dbc: Path
    usual: Any


def decoding() -> Decoding:
    """The truck's."""
    vehicle = clutchest.load_vehicle(drives.VEHICLE)
    database = load_database(vehicle)
    wanted = {name: set(layouts) for name, layouts in mapped_messages(vehicle, database).items()}
    (dbc,) = database.paths
    return Decoding(vehicle, database, wanted, dbc, cantools.database.load_file(dbc))


def formats(folder: Path, n: int, repeats: int) -> dict[str, Any]:
    vehicle, database, wanted, dbc, usual = decoding()
    frames = drives.repeated(drives.drive(600), n)
    results = {}
    for suffix in (".log", ".asc", ".blf", ".trc", ".csv", ".mf4"):
        path = folder / f"drive{suffix}"
        write_frames(frames, path)
        limit, scan = limits.LIMITS.get(suffix, limits.SCAN)
        what: dict[str, Callable[[], object]] = {
            "clutchest": lambda p=path: read_and_decode(p, vehicle, database),
            "clutchest, frames only": lambda p=path: sum(map(len, read_blocks(p))),
            "clutchest, canonical signals": lambda p=path: clutchest.read_log(p, vehicle),
            f"the limit: {limit}": lambda p=path, scan=scan: scan(p),
        }
        if suffix == ".mf4":
            what["asammdf"] = lambda p=path: peers.extract_bus_logging(p, dbc)
        else:
            what["python-can + cantools"] = lambda p=path: peers.read_and_decode(p, usual, wanted)
        assert sum(map(len, read_blocks(path))) == n
        results[suffix] = against(in_turn(what, repeats), "clutchest", n, suffix)
        path.unlink()
    return results


def others(folder: Path, n: int, repeats: int) -> dict[str, Any]:
    """The peers that do a part of the road."""
    vehicle, database, wanted, dbc, usual = decoding()
    frames = drives.repeated(drives.drive(600), n)
    blf, packed, mdf = (folder / name for name in ("a.blf", "packed.mf4", "a.mf4"))
    write_frames(frames, blf)
    write_frames(frames, packed)
    with MDF(packed) as file:
        file.save(mdf, compression=0, overwrite=True)
    results = {}
    if peers.installed("vblf"):
        what: dict[str, Callable[[], object]] = {
            "clutchest": lambda: read_and_decode(blf, vehicle, database),
            "vblf + cantools": lambda: peers.by_vblf(blf, usual, wanted),
        }
        results["vblf"] = against(in_turn(what, repeats), "clutchest", n, ".blf")
    if peers.installed("can_decoder"):
        theirs = peers.by_can_decoder(frames, dbc)
        what = {
            "clutchest": lambda: frames.decode(dbc).to_arrow(),
            "can_decoder": theirs,
        }
        results["can_decoder"] = against(in_turn(what, repeats), "clutchest", n, "in memory")
    if peers.installed("mf4_rs"):
        what = {
            "clutchest": lambda: sum(map(len, read_blocks(mdf))),
            "mf4-rs, plain channels": peers.plain_channels(folder / "plain.mf4", frames),
        }
        results["mf4_rs"] = against(in_turn(what, repeats), "clutchest", n, "raw .mf4, frames only")
    return results


def parquet(folder: Path, n: int) -> dict[str, float]:
    """All signals of a candump log that python-can would read, to Parquet, a block at a time."""
    dbc = load_database(clutchest.load_vehicle(drives.VEHICLE)).paths[0]
    path = folder / "large.log"
    write_frames(drives.repeated(drives.drive(600), n), path)
    script = Path(__file__).with_name("to_parquet.py")
    begin = perf_counter()
    command = [sys.executable, str(script), str(path), str(dbc), str(folder / "parquet")]
    used = json.loads(
        subprocess.run(
            [sys.executable, "-S", "-c", _STARTER, *command], stdout=subprocess.PIPE, check=True
        ).stdout
    )
    seconds = perf_counter() - begin
    rows = sum(pq.read_metadata(p).num_rows for p in (folder / "parquet").glob("*.parquet"))
    print(f"\n{rows} frames of {path.stat().st_size / 1e9:.2f} GB to Parquet: {seconds:.1f} s,")
    print(f"  {used[1] / rows * 1e6:.2f} µs of processor per frame, {used[2] / 1024:.0f} MiB")
    return {"frames": rows, "seconds": seconds, "cpu_seconds": used[1], "MiB": used[2] / 1024}


def replay(folder: Path, repeats: int, seconds: float) -> dict[str, Any]:
    """The peer reads and decodes as above, then filters event by event with filterpy."""
    from clutchest.estimate.ekf import OnlineFilter
    from clutchest.estimate.initial_state import fresh
    from clutchest.estimate.timeline import build
    from clutchest.estimate.whole_log import compile_model, delays
    from clutchest.record.files import write_run

    vehicle, _, wanted, _, usual = decoding()
    frames = drives.drive(seconds)
    path = folder / "drive.log"
    write_frames(frames, path)
    signals = clutchest.read_log(path, vehicle)
    compiled = compile_model(vehicle, machine_of(vehicle.model).equations(signals))
    line = build(signals, vehicle, compiled.model, 10.0, delays(vehicle))
    start = fresh(vehicle, compiled, line)

    def ours() -> None:
        signals = clutchest.read_log(path, vehicle, traffic=False)  # as `clutchest replay` does
        write_run(clutchest.replay(signals, vehicle), folder / "out")

    def theirs() -> None:
        peers.read_and_decode(path, usual, wanted)
        OnlineFilter(compiled, start, line).run()

    ours()
    times = in_turn({"clutchest": ours, "python-can, cantools, filterpy": theirs}, repeats)
    return against(times, "clutchest", len(frames), "whole replay, recording included")


# A process counts the memory of the one that started it as its own: a small one has to.
_STARTER = """
import json, resource, subprocess, sys
status = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([status, used.ru_utime + used.ru_stime, used.ru_maxrss]))
"""


def _replayed(log: Path, out: Path) -> dict[str, float]:
    """`clutchest replay` in a process of its own: seconds of wall clock, peak memory in MiB."""
    begin = perf_counter()
    command = f"{sys.executable} -m clutchest replay {log} --vehicle {drives.VEHICLE} --out {out}"
    told = subprocess.run(
        [sys.executable, "-S", "-c", _STARTER, *command.split()], stdout=subprocess.PIPE, check=True
    )
    status, cpu, peak = json.loads(told.stdout)
    if status:
        sys.exit(f"clutchest replay {log} failed")
    return {"seconds": perf_counter() - begin, "cpu_seconds": cpu, "MiB": peak / 1024}


def hour(folder: Path, repeats: int) -> dict[str, Any]:
    frames = drives.drive(3600)
    write_frames(frames, folder / "hour.log")
    runs = [_replayed(folder / "hour.log", folder / "out") for _ in range(repeats + 1)][1:]
    result = {key: spread([run[key] for run in runs]) for key in runs[0]}
    print(f"\none hour, {len(frames)} frames, min / median / max")
    print(
        f"  wall clock {told(result['seconds'], 's')}, processor "
        f"{told(result['cpu_seconds'], 's')}, memory {told(result['MiB'], 'MiB')}"
    )
    return {"frames": len(frames), **result}


def linear(folder: Path, most: int) -> list[dict[str, float]]:
    """The whole replay in this process, so that starting it does not hide the slope."""
    from clutchest.record.files import write_run

    vehicle = clutchest.load_vehicle(drives.VEHICLE)
    frames = drives.drive(1200)
    print("\nwhole replay by the number of frames")
    curve = []
    for n in (int(n) for n in np.logspace(4, 7, 7) if n <= most * 1.001):
        write_frames(drives.repeated(frames, n), folder / "part.log")
        begin = perf_counter()
        signals = clutchest.read_log(folder / "part.log", vehicle, traffic=False)
        write_run(clutchest.replay(signals, vehicle), folder / "out")
        seconds = perf_counter() - begin
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        curve.append(
            {"frames": n, "seconds": seconds, "us_per_frame": seconds / n * 1e6, "MiB": peak}
        )
        print(f"  {n:9d} frames {seconds:8.2f} s {seconds / n * 1e6:8.2f} µs/frame {peak:6.0f} MiB")
    return curve


def memory(folder: Path, gigabytes: list[float]) -> list[dict[str, float]]:
    """Files of 500 frames/s that are mapped among 4500 that are not, as on a busy bus."""
    frames = drives.busy(drives.drive(1200))
    print("\nmemory of `clutchest replay` by the size of the log")
    curve = []
    for size in gigabytes:
        path = folder / "busy.log"
        drives.write_repeated(frames, path, int(size * 1e9))
        used = _replayed(path, folder / "out")
        curve.append({"gigabytes": path.stat().st_size / 1e9, **used})
        print(f"  {size:5.2f} GB {used['seconds']:8.1f} s {used['MiB']:6.0f} MiB")
        path.unlink()
    return curve


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parts = ("formats", "others", "parquet", "replay", "hour", "linear", "memory")
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(parts))
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=600.0, help="of drive in `replay`")
    parser.add_argument("--most", type=float, default=1e7)
    parser.add_argument("--gigabytes", type=float, nargs="+", default=[0.2, 0.6, 2.0])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    if unknown := set(given.parts) - set(parts):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(parts)}")
    with TemporaryDirectory() as name:
        folder = Path(name)
        calls: dict[str, Callable[[], object]] = {
            "formats": lambda: formats(folder, given.frames, given.repeats),
            "others": lambda: others(folder, given.frames, given.repeats),
            "parquet": lambda: parquet(folder, given.frames),
            "replay": lambda: replay(folder, given.repeats, given.seconds),
            "hour": lambda: hour(folder, given.repeats),
            "linear": lambda: linear(folder, int(given.most)),
            "memory": lambda: memory(folder, given.gigabytes),
        }
        results = {part: calls[part]() for part in parts if part in given.parts or not given.parts}
    if given.json:
        given.json.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
