"""Feeds damaged inputs to every reader: PYTHONPATH=tests python -m fuzz [--inputs 100000]

Logs, vehicle files, databases, states, decoded tables, effects files, datagrams; --formats names
some by their suffix.  Each input must give what is sound, or a ClutchestError in one line, without
a warning of a library, within --seconds of processor time (and ten times as long by the clock, for
what waits) and without growing the process beyond --mebibytes.  An input that does otherwise is
kept in --keep and ends the run.
With NUMBA_BOUNDSCHECK=1 (and a NUMBA_CACHE_DIR of its own) every index of the compiled readers is
checked too.

Input k of a seed is always the same.  SIGINT and SIGTERM end a run with its counts; with --record
FILE they are kept there, also while it runs, and the next run with that file goes on behind them.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import signal
import sys
from collections import Counter
from collections.abc import Callable
from io import BytesIO
from math import inf
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import perf_counter
from types import FrameType
from warnings import catch_warnings

import numpy as np

from clutchest.can import log_source
from clutchest.can.files import blocks_of, read_frames
from clutchest.can.frames import Frames
from clutchest.can.log_source import LogSource
from clutchest.errors import ClutchestError
from fuzz import kinds
from fuzz.mutate import packed, zipped

OFTEN = 1000  # inputs, after which the counts are kept


def sound(frames: Frames) -> None:
    """Raises AssertionError if the columns contradict each other or the bus."""
    n, width = frames.data.shape
    assert width in (8, 64) and n > 0
    for name in ("t_ns", "channel", "id", "flags", "length"):
        assert len(getattr(frames, name)) == n, name
    assert int(frames.length.max()) <= 64
    assert int(frames.id.max()) < 1 << 29
    behind = np.arange(width) >= frames.length[:, None]
    assert not np.any(frames.data[behind]), "payload behind its length"
    assert all(reason and count > 0 for reason, count in frames.rejected)


def damaged(seeds: dict[str, bytes], random: Random) -> tuple[str, bytes]:
    """(name of the seed, content) of the next input."""
    name = random.choice(list(seeds))
    content = kinds.damaged(name, seeds[name], list(seeds.values()), random)
    if name.endswith(".blf"):
        content = packed(content, random)
    if random.random() < 0.05:
        content = zipped(content, random)
    return name, content


def judged(path: Path, content: bytes) -> str:
    """``frames`` or ``refused``.  Raises AssertionError, or whatever else a reader let through."""
    try:
        if content[:3] in (b"MDF", b"UnF", b"SQL"):  # asammdf and SQLite want a file
            path.write_bytes(content)
            frames = read_frames(path)
        else:
            frames = Frames.concatenate(list(blocks_of(LogSource(path, BytesIO(content)))))
    except ClutchestError as problem:
        assert str(path) in str(problem), "the error does not name the file"
        assert "\n" not in str(problem), "the error has several lines"
        return "refused"
    sound(frames)
    return "frames"


def _suffix(name: str) -> str:
    return kinds.kind_of(name) or Path(name).suffix


def _judged(path: Path, name: str, content: bytes) -> str:
    if kinds.kind_of(name):
        return kinds.judged(path.parent, name, content)
    return judged(path, content)


def peak_MiB() -> float:
    """The most memory that this process has held."""
    import resource  # of POSIX

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


class TooSlow(BaseException):
    """An input takes too long; no Exception, which a reader may take for a parser's."""


def _within(seconds: float) -> None:
    """So much processor time from now on, on a busy machine too; 0 ends it.  Where compiled code
    does not let go, the process ends with its stack; the record says among which inputs."""
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, 10 * seconds)
    if seconds:
        faulthandler.dump_traceback_later(20 * seconds, exit=True)
    else:
        faulthandler.cancel_dump_traceback_later()


def _too_slow(signum: int, frame: FrameType | None) -> None:
    raise TooSlow("took too long")


def seeds_of(formats: list[str]) -> dict[str, bytes]:
    """Name → content of the sound inputs of these formats, of all if none is named."""
    every = {path.name: path.read_bytes() for path in sorted(kinds.SEEDS.iterdir())}
    wanted = set(formats)
    if not wanted or wanted & set(kinds.KINDS):
        every |= kinds.seeds(wanted)
    return {n: c for n, c in every.items() if not wanted or _suffix(n) in wanted}


class Stop:
    """Whether SIGINT or SIGTERM came; they end a run behind the input under way."""

    def __init__(self) -> None:
        self.came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._come)

    def _come(self, signum: int, frame: FrameType | None) -> None:
        self.came = True


class Record:
    """The counts of a run so far, in a file if there is one."""

    def __init__(self, path: Path | None, given: dict[str, object]) -> None:
        self.path, self.given, self.results = path, given, Counter[str]()
        if path is not None and path.exists():
            kept = json.loads(path.read_text())
            if kept["of"] != given:
                raise SystemExit(f"{path}: of another run, {kept['of']}; expected {given}")
            self.results.update(kept["results"])

    def keep(self) -> None:
        """Write the file, whole or not at all."""
        if self.path is not None:
            part = self.path.with_name(self.path.name + ".part")
            part.write_text(json.dumps({"of": self.given, "results": self.results}, indent=1))
            part.replace(self.path)


def fuzz(
    inputs: int,
    seed: int,
    formats: list[str],
    seconds: float,
    keep: Path,
    mebibytes: float = 600.0,
    record: Record | None = None,
    ended: Callable[[], bool] = lambda: False,
) -> Counter[str]:
    """What became of ``inputs`` by format, or of those until it ``ended``, with those that are in
    the ``record`` already.

    Raises the first thing that is not allowed: what a reader should not let through, more than so
    many ``seconds`` of an input, or ``mebibytes`` of a process that has not held as much before.
    """
    allowed = max(mebibytes, peak_MiB())
    log_source.BLOCK = 1 << 14  # so that files have several, and little memory to clear
    seeds, record = seeds_of(formats), record or Record(None, {})
    results = record.results
    for number in (signal.SIGPROF, signal.SIGALRM):
        signal.signal(number, _too_slow)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "input"
        for name, content in seeds.items():  # as they are; also compiles
            assert _judged(path, name, content) in ("frames", "read"), name
        assert judged(path, b"no log at all") == "refused"
        for i in range(results.total(), inputs):
            if ended():
                break
            name, content = damaged(seeds, Random(f"{seed} {i}"))
            _within(seconds)
            try:
                with catch_warnings(record=True) as said:
                    result = _judged(path, name, content)
                assert not said, f"a library's warning: {said[0]}"
                assert peak_MiB() <= allowed, "more memory than is allowed"
            except BaseException:
                _within(0)
                keep.mkdir(parents=True, exist_ok=True)
                kept = keep / f"{seed}-{i}-{name}"
                kept.write_bytes(content)
                print(f"kept: {kept}", file=sys.stderr)
                raise
            _within(0)
            results[f"{_suffix(name)} {result}"] += 1
            if i % OFTEN == 0:
                record.keep()
    record.keep()
    return results


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--formats", nargs="*", default=[], metavar="SUFFIX")
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--mebibytes", type=float, default=600.0)
    parser.add_argument("--minutes", type=float, default=inf, help="stop after so many")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"))
    parser.add_argument("--record", type=Path, metavar="FILE")
    given = parser.parse_args()
    faulthandler.enable()
    stop, begin = Stop(), perf_counter()
    record = Record(given.record, {"seed": given.seed, "formats": given.formats})
    before = record.results.total()
    try:
        fuzz(
            given.inputs,
            given.seed,
            given.formats,
            given.seconds,
            given.keep,
            given.mebibytes,
            record,
            lambda: stop.came or perf_counter() > begin + 60.0 * given.minutes,
        )
    finally:
        for what, count in sorted(record.results.items()):
            print(f"{what:20s} {count:9d}")
        print(
            f"{record.results.total()} inputs, {record.results.total() - before} of them in "
            f"{perf_counter() - begin:.0f} s, peak memory {peak_MiB():.0f} MiB",
            flush=True,
        )


if __name__ == "__main__":
    main()
