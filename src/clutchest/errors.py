"""The one exception that a user may see, and the hint at what they may have meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


class ClutchestError(Exception):
    """Bad input, in one line: where, what was expected, and the nearest valid thing.

    The command line prints it without a traceback and ends with exit code 1.  What it quotes of a
    library or a file may have several lines; they become one.
    """

    def __init__(self, said: str) -> None:
        super().__init__(" ".join(line.strip() for line in said.splitlines()))


class UnknownNameError(ClutchestError, KeyError):
    """A name that a mapping does not have, so that its ``get`` works as any other's."""

    __str__ = Exception.__str__  # KeyError quotes what it says


MOST = 16  # names that a message lists


def nearest(given: str, valid: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` for the closest valid names, else a list of what is valid."""
    names = sorted(set(valid))
    if close := alike(str(given), names):
        return close
    if not names:
        return ""
    shown = ", ".join(names[:MOST]) + (", …" if len(names) > MOST else "")
    return f"; valid: {shown}"


def alike(given: str, valid: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` for the closest valid names, empty if none is close."""
    lowered = {name.lower(): name for name in sorted(set(valid))}
    close = [lowered[m] for m in get_close_matches(given.lower(), lowered, n=3, cutoff=0.55)]
    return "; did you mean " + " or ".join(map(repr, close)) + "?" if close else ""


def file_like(path: Path, stock: Iterable[str] = ()) -> str:
    """The same for a file that is not there, among those of its folder and names in ``stock``."""
    try:
        there = [other.name for other in path.parent.iterdir() if other.is_file()]
    except OSError:
        there = []
    return alike(path.name, (*there, *stock))
