"""Days of driving through a live session as fast as it takes them: memory, and equality with a
replay of what was received.

    python benchmarks/live/soak.py [--frames 10000000] [--hour 3600] [--seed 1]

A simulated city drive of so many seconds is driven again and again, an hour and more apart, so that
each is a drive of its own.  A bus hands over the frames with a clock that runs with them.  The
faults of frames and signals are tested all the time, those of the equations are not.
"""

from __future__ import annotations

import argparse
import gc
import os
import shutil
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

import can
import clutchest
from clutchest.can.bus import BusReader, Received
from clutchest.can.frames import Frames
from clutchest.monitor import listener
from clutchest.monitor.faults import FaultWatcher
from clutchest.monitor.stamps import Stamps
from clutchest.reading import load_database
from clutchest.simulated import simulate_frames

BATCH, WAITING = 1000, 4  # frames in one go, and batches that wait to be taken
APART_NS = 4000 * 10**9  # from the end of a drive to the next one
STAGES = 10  # at which memory is looked at


class Accelerated(BusReader):
    """A bus that brings a drive again and again, with a clock of its own."""

    def __init__(self, bus: can.BusABC, drive: Frames, frames: int) -> None:
        super().__init__(bus)
        self.dropped = 0
        self.drive, self.left, self.at = drive, frames, 0
        self.shift_ns = self.now_ns = 0
        self.queue = None

    def read(self, timeout: float) -> Received | None:
        """The next frames, as soon as the ones before have been taken."""
        if not self.left or (self.queue is not None and self.queue.qsize() >= WAITING):
            time.sleep(0.002)
            return None
        if self.at >= len(self.drive):
            self.at = 0
            self.shift_ns += int(np.ptp(self.drive.t_ns)) + APART_NS
        upto = min(self.at + BATCH, self.at + self.left, len(self.drive))
        part = self.drive.take(np.arange(self.at, upto))
        part = replace(part, t_ns=part.t_ns + self.shift_ns)
        self.left, self.at, self.now_ns = self.left - len(part), upto, int(part.t_ns[-1])
        return Received(part, self.now_ns, 0)


def memory_MiB() -> float:
    """Resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def soak(frames: int, drive: Frames, out: Path) -> None:
    """Run the session; what it took."""
    truck = clutchest.load_vehicle("truck")
    bus = can.Bus(interface="virtual", channel="soak")
    reader = Accelerated(bus, drive, frames)
    listener.reader_of = lambda _: reader
    listener.QUIET_NS = 1 << 62  # no silence: the clock runs with the frames
    tests = FaultWatcher(truck, load_database(truck), share=None, log=out / "received.log")
    tests.finish = lambda now: []
    monitor = clutchest.Monitor(bus, truck, out=out, watchers=[tests])
    monitor._reception._stamps = Stamps(lambda: reader.now_ns, lambda: reader.now_ns)
    reader.queue = monitor._reception._listener.received
    memory, begun = [], time.process_time()

    def show(status, piece, events):
        if status.frames >= (len(memory) + 1) * frames / STAGES:
            memory.append(memory_MiB())
            print(f"  {status.frames} frames, {status.rows} rows, {memory[-1]:.0f} MiB", flush=True)
        if status.frames >= frames:
            monitor.stop()

    status = monitor.run(None, show)
    used = time.process_time() - begun
    print(
        f"{status.frames} frames, {status.lost} lost, {status.rows} rows, "
        f"{monitor._drive + 1} drives; {used:.0f} s of a processor"
    )


def same(out: Path) -> None:
    """Compare every number with a replay of what was received."""
    truck = clutchest.load_vehicle("truck")
    live = pd.read_parquet(out / "estimates.parquet")
    gc.collect()
    whole = clutchest.replay(clutchest.read_log(out / "received.log", truck), truck).to_pandas()
    rows, worst, bits = min(len(live), len(whole)), 0.0, True
    for name in (n for n in whole.columns if f"{n}_std" in whole.columns):
        a, b = live[name].to_numpy()[:rows], whole[name].to_numpy()[:rows]
        bits &= np.array_equal(a, b, equal_nan=True)
        apart = np.abs(a - b) / np.maximum(whole[f"{name}_std"].to_numpy()[:rows], 1e-300)
        worst = max(worst, float(np.nanmax(apart, initial=0.0)))
    modes = int((live["mode"].astype(str)[:rows] != whole["mode"].astype(str)[:rows]).sum())
    print(
        f"{len(live)} rows live, {len(whole)} of a replay of received.log; modes that differ: "
        f"{modes}; largest difference {worst:.2g} standard deviations{', bit by bit' * bits}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=10_000_000)
    parser.add_argument("--hour", type=float, default=3600.0, help="s of a drive")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="a folder for the session's files")
    given = parser.parse_args()
    drive, _ = simulate_frames(
        clutchest.load_vehicle("truck"), "city", given.seed, duration=given.hour
    )
    with TemporaryDirectory() as folder:
        out = given.keep or Path(folder) / "out"
        shutil.rmtree(out, ignore_errors=True)
        soak(given.frames, drive.sorted(), out)
        same(out)


if __name__ == "__main__":
    main()
