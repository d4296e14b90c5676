"""A drive in real time over a bus with foreign traffic: lost frames, latency of the estimates,
growth of memory, and equality with a replay of the received frames.

    python benchmarks/live [--interface I --channel C] [--duration S] [--foreign N] [--silence S]
    python benchmarks/live --duration 2000 --speed 4        a million frames
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

import clutchest
from clutchest.can.bus import open_bus
from clutchest.can.files import read_frames, write_frames
from clutchest.can.player import play
from clutchest.monitor.faults import FaultWatcher
from clutchest.reading.log import load_database
from clutchest.simulated import simulate_frames

FORK = multiprocessing.get_context("fork")


class Timed(clutchest.Monitor):
    """A monitor that measures the cost of a row: processor time ``used``, s, since it took the
    frames that made the row final."""

    def _receive(self, wait: float):
        self._begun = time.thread_time()
        return super()._receive(wait)

    @property
    def used(self) -> float:
        return time.thread_time() - self._begun


def memory_MiB() -> float:
    """Resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, prog="benchmarks/live")
    parser.add_argument("--interface", default="udp_multicast")
    parser.add_argument("--channel", default=None)
    parser.add_argument("--duration", type=float, default=600.0, help="s of the drive")
    parser.add_argument("--foreign", type=float, default=2000.0, help="other frames per s")
    parser.add_argument("--silence", type=float, default=0.0, help="s in the middle")
    parser.add_argument("--speed", type=float, default=1.0, help="times real time")
    return parser.parse_args()


def drive(folder: Path, seconds: float) -> list[Path]:
    """A simulated city drive as two halves of one log."""
    frames, _ = simulate_frames(clutchest.load_vehicle("truck"), "city", 1, duration=seconds)
    t = (frames.t_ns - frames.t_ns[0]) / 1e9
    halves = []
    for k, part in enumerate((t < seconds / 2, t >= seconds / 2)):
        halves.append(folder / f"half{k}.log")
        write_frames(frames.take(part), halves[-1])
    return halves


def send(asked: argparse.Namespace, halves: list[Path], lateness) -> None:
    bus = open_bus(asked.interface, asked.channel)
    late = []
    for k, half in enumerate(halves):
        if k:
            time.sleep(asked.silence)
        late.append(play(half, bus, speed=asked.speed).late)
    bus.shutdown()
    lateness.put(max(late))


def foreign_traffic(asked: argparse.Namespace) -> None:
    """Frames of messages that are not mapped."""
    import can

    bus = open_bus(asked.interface, asked.channel)
    begin, sent = time.monotonic(), 0
    while True:
        while sent < asked.foreign * (time.monotonic() - begin):
            bus.send(
                can.Message(
                    arbitration_id=0x100 + sent % 0x300, is_extended_id=False, data=b"foreign!"
                )
            )
            sent += 1
        time.sleep(0.005)


def same(out: Path) -> float:
    """The largest difference between the session and a replay, in standard deviations."""
    truck = clutchest.load_vehicle("truck")
    whole = clutchest.replay(clutchest.read_log(out / "received.log", truck), truck).to_pandas()
    live = pd.read_parquet(out / "estimates.parquet")
    rows = min(len(whole), len(live))
    print(f"  rows: {len(live)} live, {len(whole)} in a replay of received.log")
    worst = 0.0
    for name in whole.columns:
        if f"{name}_std" in whole.columns:
            a, b = live[name].to_numpy()[:rows], whole[name].to_numpy()[:rows]
            apart = np.abs(a - b) / np.maximum(whole[f"{name}_std"].to_numpy()[:rows], 1e-300)
            worst = max(worst, float(np.nanmax(apart, initial=0.0)))
    modes = (live["mode"].astype(str)[:rows] != whole["mode"].astype(str)[:rows]).sum()
    print(f"  modes that differ: {modes}; largest difference {worst:.2g} standard deviations")
    return worst


def real_time(asked: argparse.Namespace, folder: Path) -> None:
    halves = drive(folder, asked.duration)
    sent = sum(len(read_frames(half)) for half in halves)
    out = folder / "out"
    sent_late = FORK.Queue()
    truck = clutchest.load_vehicle("truck")
    faults = FaultWatcher(truck, load_database(truck), log=out / "received.log")
    monitor = Timed(open_bus(asked.interface, asked.channel), truck, out=out, watchers=[faults])
    senders = [FORK.Process(target=send, args=(asked, halves, sent_late), daemon=True)]
    if asked.foreign:
        senders.append(FORK.Process(target=foreign_traffic, args=(asked,), daemon=True))
    for sender in senders:
        sender.start()
    lateness, effort, memory, begun = [], [], [], time.monotonic()

    def show(status, piece, events):
        if piece is not None and not piece.begins and len(piece.track.time):
            lateness.append((time.time_ns() - piece.released_ns) / 1e6)
            effort.append(1e3 * monitor.used)
        if len(memory) < (time.monotonic() - begun) / 5.0:
            memory.append(memory_MiB())
        if not senders[0].is_alive():
            monitor.stop()

    used = time.process_time()
    status = monitor.run(None, show)
    used = (time.process_time() - used) / (time.monotonic() - begun)
    for sender in senders:
        sender.kill()
    late, effort = np.array(lateness), np.array(effort)
    received = read_frames(out / "received.log")
    print(
        f"{asked.duration:.0f} s of a city drive over {asked.interface}, {asked.speed:g} times "
        f"as fast as it was, foreign traffic {asked.foreign:.0f} frames/s, "
        f"silence {asked.silence:.0f} s"
    )
    print(
        f"  frames: {sent} sent, {len(received)} received, {status.lost} dropped by the kernel; "
        f"the latest was sent {1e3 * sent_late.get():.1f} ms late"
    )
    print(
        "  from the frame that makes an estimate final to its output: median "
        f"{np.median(late):.1f} ms, p90 {np.percentile(late, 90):.1f} ms, p99 "
        f"{np.percentile(late, 99):.1f} ms, most {late.max():.1f} ms"
    )
    print(
        f"  of it this program's own work: median {np.median(effort):.1f} ms, p90 "
        f"{np.percentile(effort, 90):.1f} ms, p99 {np.percentile(effort, 99):.1f} ms "
        "of a processor"
    )
    eighths = [memory[len(memory) * k // 8] for k in range(1, 8)] + memory[-1:]
    print(
        f"  processor: {100 * used:.0f} % of one core; memory in MiB after every eighth: "
        f"{' '.join(f'{m:.0f}' for m in eighths)}"
    )
    kinds = pd.Series([json.loads(line)["kind"] for line in (out / "events.jsonl").open()])
    print(f"  events: {kinds.value_counts().to_dict()}")
    same(out)


def main() -> None:
    asked = arguments()
    with TemporaryDirectory() as name:
        real_time(asked, Path(name))


if __name__ == "__main__":
    main()
