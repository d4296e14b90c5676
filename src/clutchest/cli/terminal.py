"""What the verbs say alike: how far they are, what came out, what went wrong."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any, NoReturn

from clutchest.progress import Progress

if TYPE_CHECKING:
    from rich.console import Console

    from clutchest.vehicle import Vehicle


@contextmanager
def progress() -> Iterator[Progress]:
    """Shows ``(text, share done or None)`` as a bar on stderr; in a pipe it stays quiet."""
    if not sys.stderr.isatty():
        yield lambda text, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def show(text: str, share: float | None) -> None:
            total = None if share is None else 1.0
            bar.update(task, description=text, total=total, completed=share or 0.0)

        yield show


def meanwhile(module: str) -> None:
    """Load what is needed in the end while compiled code, which leaves Python alone, does its
    work."""
    Thread(target=import_module, args=(module,)).start()


def print_json(value: Any) -> None:
    """Strict JSON on stdout."""
    from clutchest.record.files import json_text

    sys.stdout.write(json_text(value))


def answer(
    value: Any, as_json: bool, words: Callable[[Console], None], out: Path, written: Collection[str]
) -> None:
    """Say what came out: ``value`` as JSON and nothing else, or in ``words``, and the names of
    the files ``written`` into ``out``."""
    if as_json:
        print_json(value)
        return
    from rich.console import Console

    words(Console())
    print(f"Written to {out}: {', '.join(written)}")
    if "recording.rrd" in written:
        print(f"To view it: rerun {out / 'recording.rrd'}")


def loaded(vehicle: str, trust: bool) -> Vehicle:
    """The vehicle; what is unlikely in its file is said on stderr."""
    from clutchest.vehicle import load_vehicle

    car = load_vehicle(vehicle, trust=trust)
    for words in car.notes:
        note(f"warning: {words}")
    return car


def note(text: str) -> None:
    """A remark beside the result, on stderr."""
    print(text, file=sys.stderr)


def fail(problem: str) -> NoReturn:
    """One line on stderr, and exit code 1."""
    note(f"clutchest: {' '.join(problem.split())}")
    sys.exit(1)
