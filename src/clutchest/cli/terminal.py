"""What the verbs say alike: how far they are, what came out, what went wrong."""

from __future__ import annotations

import codecs
import os
import sys
import tempfile
import traceback
import unicodedata
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any, NoReturn

from clutchest import __version__
from clutchest.extras import installed
from clutchest.patient_loading import load_patiently
from clutchest.progress import Progress

if TYPE_CHECKING:
    from rich.console import Console

    from clutchest.shown import Shown
    from clutchest.vehicle import Vehicle


RECORDED = {"summary.json", "diagnosis.json", "discovery.json"}  # a recording is beside these
_FORMS = {
    "±": "+/-",
    "−": "-",
    "–": "-",
    "—": "-",
    "σ": "sigma",
    "Δ": "Delta",
    "×": "x",
    "·": ".",
    "≥": ">=",
    "≤": "<=",
    "…": "...",
    "°": "deg ",
    "′": "'",
    "√": "sqrt",
    "→": "->",
    "█": "#",
    "²": "^2",
    "³": "^3",
    "χ": "chi",
    "Ω": "Ohm",
    "μ": "u",
    "ω": "omega",
    "α": "alpha",
    **dict.fromkeys("─━═╌┄┅┈┉╴╶", "-"),
    **dict.fromkeys("│┃║", "|"),
    **dict.fromkeys("┌┐└┘├┤┬┴┼┏┓┗┛┡┩╇╈┯┷╭╮╰╯", "+"),
}  # what stands for it in ASCII


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


def meanwhile(*modules: str) -> None:
    """Load what is needed in the end while compiled code, which leaves Python alone, does its
    work."""

    def load() -> None:
        with suppress(Exception):  # where the module is needed it fails again, and is answered
            load_patiently(modules)

    Thread(target=load).start()


def print_json(value: Any, indent: int | None = 2) -> None:
    """Strict JSON on stdout, in an object per line without ``indent``."""
    from clutchest.record.files import json_text

    unicode = (sys.stdout.encoding or "").lower().startswith("utf")
    sys.stdout.write(json_text(value, ascii_only=not unicode, indent=indent))


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
    elif RECORDED & set(written) and not installed("rerun"):
        print("Without a recording for the Rerun viewer: pip install 'clutchest[rerun]'")


def print_shown(shown: Shown, console: Console) -> None:
    """Print a line and the table below it."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(*map(escape, shown.header))
    for row in shown.rows:
        table.add_row(*map(escape, row))
    console.print(escape(shown.line))  # as a title it would be as narrow as the table
    console.print(table)


def loaded(vehicle: str, trust: bool) -> Vehicle:
    """The vehicle; what is unlikely in its file is said on stderr."""
    from clutchest.vehicle import load_vehicle

    car = load_vehicle(vehicle, trust=trust)
    for words in car.notes:
        note(f"warning: {words}")
    return car


def note(text: str) -> None:
    """A remark beside the result, on stderr, while there is anybody to read it."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def hush() -> None:
    """What stdout has not taken, and will not take any more, is dropped."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def printable() -> None:
    """Let stdout and stderr print what their encoding has no character for, in ASCII."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="ascii_forms")


def _ascii_forms(problem: UnicodeError) -> tuple[str, int]:
    """What stands for characters that an encoding lacks: a form in ASCII, else a question mark."""
    if not isinstance(problem, UnicodeEncodeError):
        raise problem
    text = problem.object[problem.start : problem.end]
    return "".join(map(_ascii_form, text)), problem.end


def _ascii_form(character: str) -> str:
    if character in _FORMS:
        return _FORMS[character]
    plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return plain or ("?" if character.isprintable() else ascii(character)[1:-1])


codecs.register_error("ascii_forms", _ascii_forms)


def unexpected(problem: Exception) -> str:
    """One line about an error that nobody foresaw, and the file that says where it arose."""
    words = f"{type(problem).__name__}: {problem}"[:200]
    about = [
        f"clutchest {__version__}, Python {sys.version}, {sys.platform}",
        " ".join(sys.argv),
        "".join(traceback.format_exception(problem)),
    ]
    try:
        with tempfile.NamedTemporaryFile(
            "w",
            prefix="clutchest-error-",
            suffix=".txt",
            delete=False,
            encoding="utf-8",
            errors="backslashreplace",
        ) as file:
            file.write("\n\n".join(about))
    except OSError:
        return f"unexpected error: {words}"
    return f"unexpected error: {words}; please report it with {file.name}"


def fail(problem: str) -> NoReturn:
    """One line on stderr, and exit code 1."""
    note(f"clutchest: {' '.join(problem.split())}")
    sys.exit(1)
