"""Kills programs at random moments, and looks at what they leave behind.

    python benchmarks/killed.py [--kills 100] [--seed 0] [--verbs replay identify discover monitor]

``replay``, ``identify`` and ``discover`` write into one folder again and again, over two logs by
turns, and are killed (SIGKILL) anywhere on their way, half of the time while they write; now and
then without a compile cache.  The folder must hold the results of one start, old or new, all of
them.  ``monitor`` is killed while a log is played to it, mostly once there are rows; the next
session must complete its files: every row that it had shown is there, and equals a replay of what
was received.  Every start that is left alone must end well, without a word on stderr and without
leftovers.  The first violation ends the run with exit code 1.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

import clutchest
from clutchest.can.files import read_frames, write_frames
from clutchest.shipped import locate

VERBS = {"replay": ["replay"], "identify": ["identify", "noise"], "discover": ["discover"]}
LOGS = {"a": 60.0, "b": 80.0}  # s of the shipped log
RUNS = ".unfinished-"
LIVE, STARTS = 10.0, 120.0  # s, the longest session with rows, and the longest wait for them
COLD = 0.05  # share of starts without a compile cache


class Wrong(Exception):
    """Something is left that must not be."""


class Place:
    """A folder with the two logs, results to compare with, and an environment of its own."""

    def __init__(self, folder: Path, random: Random) -> None:
        self.folder, self.random = folder, random
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("", 0))
            config = json.dumps({"port": probe.getsockname()[1]})
        self.cache = folder / "cache"
        self.environment = {
            **os.environ,
            "CLUTCHEST_CACHE": str(self.cache),
            "CLUTCHEST_TRUST": str(folder / "trust"),
            "CAN_CONFIG": config,
        }
        frames = read_frames(locate("demo", "logs")).sorted()
        t = (frames.t_ns - frames.t_ns[0]) / 1e9
        for name, seconds in LOGS.items():
            write_frames(frames.take(t < seconds), folder / f"{name}.log")

    def start(self, *arguments: object, name: str = "") -> subprocess.Popen:
        """A clutchest of its own, whose words go to files."""
        paths = [self.folder / f"{name}{end}" for end in ("out", "err")]
        with paths[0].open("w") as out, paths[1].open("w") as err:
            return subprocess.Popen(
                [sys.executable, "-m", "clutchest", *map(str, arguments)],
                stdout=out,
                stderr=err,
                env=self.environment,
                cwd=self.folder,
            )

    def ended_well(self, process: subprocess.Popen) -> None:
        """Wait for a start that is left alone."""
        code, words = process.wait(), (self.folder / "err").read_text()
        words = "\n".join(x for x in words.splitlines() if "damaged, made anew" not in x)
        if code or words:
            raise Wrong(f"exit code {code}: {words}")

    def maybe_cold(self) -> None:
        """Now and then nothing is compiled yet."""
        if self.random.random() < COLD:
            shutil.rmtree(self.cache, ignore_errors=True)


def digests(out: Path) -> dict[str, str]:
    """Name → content of the files in a folder, as a hash."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(out.iterdir())
        if path.is_file()
    }


def leftovers(out: Path) -> list[str]:
    return [path.name for path in out.iterdir() if path.name.startswith(".")]


def readable(recording: Path) -> bool:
    """Whether a recording is whole; one that is not there is, too."""
    command = [sys.executable, "-m", "rerun_cli", "rrd", "verify", str(recording)]
    return not recording.exists() or not subprocess.run(command, capture_output=True).returncode


class Expected:
    """What a verb gives over each log; a file whose content varies from run to run counts by its
    name alone."""

    def __init__(self, place: Place, verb: str) -> None:
        self.seconds = 0.0
        self.files: dict[str, dict[str, str]] = {}
        for log in LOGS:
            runs = []
            for turn in range(2):
                out, begun = place.folder / f"{verb}-{log}-{turn}", time.monotonic()
                place.ended_well(place.start(*command(verb, log, out)))
                self.seconds = max(self.seconds if turn else 0.0, time.monotonic() - begun)
                runs.append(digests(out))
            same = {name: d for name, d in runs[0].items() if runs[1].get(name) == d}
            self.files[log] = {**dict.fromkeys(runs[0], ""), **same}
            if not same:
                raise Wrong(f"{verb}: no file is the same from run to run")

    def of(self, out: Path) -> str | None:
        """The log that these results are of; None where there are none."""
        found = digests(out) if out.exists() else {}
        if not found:
            return None
        for log, files in self.files.items():
            if found.keys() == files.keys() and all(
                not digest or found[name] == digest for name, digest in files.items()
            ):
                if not readable(out / "recording.rrd"):
                    raise Wrong(f"{out}: recording.rrd is not whole")
                return log
        raise Wrong(f"{out}: results of no single start: {', '.join(found)}")


def command(verb: str, log: str, out: Path) -> list[object]:
    return [*VERBS[verb], f"{log}.log", "--vehicle", "truck", "--out", out]


def survives(process: subprocess.Popen, seconds: float) -> bool:
    """Whether a process has ended by itself within so many seconds; else it is killed."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return False
    return True


def kill_verb(place: Place, verb: str, kills: int) -> str:
    """Kill a verb so many times; what was seen, in words."""
    expected, out = Expected(place, verb), place.folder / verb
    random, done, completed, writing = place.random, 0, 0, 0
    now: str | None = None
    while done < kills:
        log = random.choice(list(LOGS))
        place.maybe_cold()
        process = place.start(*command(verb, log, out))
        mine, wait = f"{RUNS}{process.pid}-*", random.uniform(0.0, 1.1 * expected.seconds)
        if random.random() < 0.5:  # while it writes
            while process.poll() is None and not list(out.glob(mine)):
                time.sleep(0.001)
            wait = random.uniform(0.0, 0.3 * expected.seconds)
        if survives(process, wait):
            place.ended_well(process)
            completed += 1
            now = expected.of(out)
            if now != log or leftovers(out):
                raise Wrong(f"{verb}: results of {now}, expected {log}; {leftovers(out)}")
            continue
        done += 1
        writing += bool(list(out.glob(mine)))
        if out.exists() and not list(out.glob(".finished-*")):  # else the next start moves them
            if (kept := expected.of(out)) not in (now, log):
                raise Wrong(f"{verb}: results of {kept}, expected those of {now} or {log}")
            now = kept
    place.ended_well(place.start(*command(verb, "a", out)))
    if expected.of(out) != "a" or leftovers(out):
        raise Wrong(f"{verb}: the last start left {leftovers(out)}")
    return f"{done} kills, {writing} of them while it wrote, {completed + 1} starts left alone"


def kill_monitor(place: Place, kills: int) -> str:
    """Kill live sessions so many times; what was seen, in words."""
    out, rows = place.folder / "live", 0
    bus = ["--interface", "udp_multicast", "--channel", "239.74.163.99"]
    live = ["monitor", "--vehicle", "truck", "--out", out, *bus]
    for _ in range(kills):
        place.maybe_cold()
        player = place.start("play", "demo", "--speed", 2, *bus, name="player ")
        session = place.start(*live, "--json")
        if place.random.random() < 0.75:  # once there are rows
            until = time.monotonic() + STARTS
            while not (out / "estimates.growing").exists() and time.monotonic() < until:
                time.sleep(0.01)
        survived = survives(session, place.random.uniform(0.0, LIVE))
        survives(player, 0.0)
        if survived:
            raise Wrong(f"monitor: ended by itself: {(place.folder / 'err').read_text()}")
        shown = rows_shown((place.folder / "out").read_text())
        received = (out / "received.log").exists()
        place.ended_well(place.start(*live, "--duration", 0.2))
        folders = sorted(out.glob("until-*"))
        if received != bool(folders):
            raise Wrong("monitor: the files of the killed session are not where they should be")
        for folder in folders:
            rows += completed_rows(folder, shown)
            shutil.rmtree(folder)
        for path in out.iterdir():  # those of the session that was left alone
            path.unlink()
    return f"{kills} kills, {rows} rows of estimates kept and equal to replays"


def rows_shown(words: str) -> list[float]:
    whole = [line for line in words.splitlines(keepends=True) if line.endswith("\n")]
    return [row["time"] for row in map(json.loads, whole) if row["kind"] == "estimate"]


def completed_rows(folder: Path, shown: Iterable[float]) -> int:
    """How many rows a killed session has left, all of which are as they should be."""
    for line in (folder / "events.jsonl").read_text().splitlines():
        json.loads(line)
    if not readable(folder / "recording.rrd") and (folder / "recording.rrd").stat().st_size > 4096:
        raise Wrong("monitor: recording.rrd is not whole")
    table = folder / "estimates.parquet"
    estimates = pd.read_parquet(table) if table.exists() else pd.DataFrame({"time": []})
    if not set(shown) <= set(estimates["time"]):
        raise Wrong("monitor: rows that were shown are lost")
    if len(estimates):
        truck = clutchest.load_vehicle("truck")
        signals = clutchest.read_log(folder / "received.log", truck)
        whole = clutchest.replay(signals, truck).to_pandas().iloc[: len(estimates)]
        for name in (n for n in whole.columns if f"{n}_std" in whole.columns):
            a, b = estimates[name].to_numpy(), whole[name].to_numpy()
            std = whole[f"{name}_std"].to_numpy()
            if not np.all((np.abs(a - b) <= 1e-9 * np.maximum(np.abs(b), std)) | np.isnan(b)):
                raise Wrong(f"monitor: {name} is not that of a replay")
    return len(estimates)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--verbs", nargs="*", default=[*VERBS, "monitor"])
    given = parser.parse_args()
    each = -(-given.kills // len(given.verbs))
    with TemporaryDirectory() as folder:
        place = Place(Path(folder), Random(given.seed))
        for verb in given.verbs:
            try:
                seen = (
                    kill_monitor(place, each) if verb == "monitor" else kill_verb(place, verb, each)
                )
            except Wrong as problem:
                sys.exit(f"{verb}, seed {given.seed}: {problem}")
            print(f"{verb}: {seen}", flush=True)


if __name__ == "__main__":
    main()
