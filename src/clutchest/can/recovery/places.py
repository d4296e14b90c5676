"""Lengths and places in databases that are no DBC, checked before cantools reads them: it makes a
list of all bits of a message."""

from __future__ import annotations

import re

from clutchest.budgets import FRAME_BITS
from clutchest.can.recovery.dbc import Irreparable

_STATED = {
    "kcd": re.compile(r"""\b(?:length|offset)\s*=\s*["']\s*([^"']*)"""),
    "arxml": re.compile(r"<(?:[\w:-]*LENGTH|[\w:-]*POSITION)\b[^>]*>\s*([^<]*)"),
    "sym": re.compile(r"(?<![\w.])(\d+)(?![\w.])"),
}
# Of a SYM: words, comments, options, values of enumerations, and what is no place.
_OTHER = re.compile(
    r'"[^"]*"|//[^\n]*|/\w+:\S*|\([^)]*\)|\b(?:CycleTime|Timeout|MinInterval|ID|Color)\s*=\s*\S+'
)


def check_places(text: str, kind: str) -> None:
    """Raises Irreparable for a length or a place beyond any message."""
    looked_at = _OTHER.sub(lambda other: _blank(other[0]), text) if kind == "sym" else text
    for stated in _STATED[kind].finditer(looked_at):
        if _is_beyond(stated[1].strip()):
            line = text.count("\n", 0, stated.start(1)) + 1
            raise Irreparable(line, f"a length or place beyond {FRAME_BITS} bits")


def _blank(text: str) -> str:
    return re.sub(r"[^\n]", " ", text)


def _is_beyond(stated: str) -> bool:
    if "&" in stated:  # a digit that is written as a reference
        return True
    try:
        return len(stated) > len(str(FRAME_BITS)) + 2 or int(stated, 0) > FRAME_BITS
    except ValueError:  # "auto", or what cantools says
        return False
