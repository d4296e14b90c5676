"""Databases that are no DBC, before cantools reads them: it makes a list of all bits of a message,
and reads what refers to others as often as there are ways to it."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from xml.parsers import expat

from clutchest.budgets import ARXML_PDUS, FRAME_BITS
from clutchest.can.recovery.dbc import Irreparable

_SYM_NUMBER = re.compile(r"(?<![\w.])(\d+)(?![\w.])")
# Of a SYM: words, comments, options, values of enumerations, and what is no place.
_SYM_OTHER = re.compile(
    r'"[^"]*"|//[^\n]*|/\w+:\S*|\([^)]*\)|\b(?:CycleTime|Timeout|MinInterval|ID|Color)\s*=\s*\S+'
)
_NUMBERS: tuple[Callable[[str], float], ...] = (float, float.fromhex, lambda text: int(text, 0))


def check(text: str, kind: str) -> None:
    """Raises Irreparable for a length or a place beyond any message, for entities of its own, and
    for PDUs that refer to each other without end."""
    if kind == "sym":
        plain = _SYM_OTHER.sub(lambda other: re.sub(r"[^\n]", " ", other[0]), text)
        for number in _SYM_NUMBER.finditer(plain):
            if _largest(number[1]) > FRAME_BITS:
                raise _beyond(text.count("\n", 0, number.start()) + 1)
    else:
        _Xml(kind).check(text)


def _beyond(line: int) -> Irreparable:
    return Irreparable(line, f"a length or place beyond {FRAME_BITS} bits")


def _largest(stated: str) -> float:
    """The largest number that a text may be taken for; 0 for one that is no number."""
    found = [0.0]
    for number in _NUMBERS if "x" in stated.lower() else (_NUMBERS[0], _NUMBERS[2]):
        try:
            found.append(number(stated))
        except ValueError:
            continue
        except OverflowError:
            return float("inf")
    return max(found)


class _Xml:
    """An ARXML or KCD file: its lengths and places, and what the PDUs of an ARXML refer to.

    Of an element what stands before its first child counts, as ElementTree has it.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.tag, self.text = "", [""]  # of the element whose text is under way
        self.depth = 0  # elements that are open
        self.named: list[tuple[int, str]] = []  # depth and name of those of them that have one
        self.parameter = ""  # of an ECU extract, to which the next value belongs
        self.refers: dict[str, list[str]] = {}  # name → those that it refers to
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._add
        self.parser.EntityDeclHandler = self._entity

    def check(self, text: str) -> None:
        """Raises Irreparable.  What is no XML, cantools says."""
        with suppress(expat.ExpatError):
            self.parser.Parse(text, True)
        if _reads(self.refers) > ARXML_PDUS:
            raise Irreparable(0, f"its PDUs refer to each other in more than {ARXML_PDUS} ways")

    def _entity(self, *_: object) -> None:
        raise Irreparable(self.parser.CurrentLineNumber, "defines entities of its own")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._complete()
        self.depth, self.tag = self.depth + 1, tag.rpartition(":")[2]
        if self.kind == "kcd":
            self._check_place(attributes.get("length", ""))
            self._check_place(attributes.get("offset", ""))

    def _add(self, text: str) -> None:
        if self.tag:
            self.text.append(text)

    def _end(self, tag: str) -> None:
        self._complete()
        self.depth -= 1
        while self.named and self.named[-1][0] > self.depth:
            self.named.pop()

    def _complete(self) -> None:
        """The text under way is whole."""
        if self.tag and self.kind == "arxml":
            self._look_at(self.tag, "".join(self.text).strip())
        self.tag, self.text = "", []

    def _look_at(self, tag: str, text: str) -> None:
        last = text.rpartition("/")[2]
        if tag == "SHORT-NAME":
            self.named.append((self.depth - 1, last))
        elif tag == "DEFINITION-REF":
            self.parameter = last
        elif tag in _REFERENCES and self.named:
            self.refers.setdefault(self.named[-1][1], []).append(last)
        elif tag.endswith(("LENGTH", "POSITION")) or (
            tag == "VALUE" and self.parameter.endswith(("BitSize", "BitPosition", "Dlc"))
        ):
            self._check_place(text)

    def _check_place(self, stated: str) -> None:
        if _largest(stated) > FRAME_BITS:
            raise _beyond(self.parser.CurrentLineNumber)


_REFERENCES = ("PDU-REF", "I-PDU-REF", "PAYLOAD-REF", "CONTAINED-PDU-TRIGGERING-REF")


def _reads(refers: dict[str, list[str]]) -> int:
    """How often anything is read, where each is read with all that it refers to as often as there
    are ways to it; one that returns to itself ends there."""
    reads: dict[str, int] = {}
    for first in refers:
        way, onto = [(first, iter(refers[first]))], {first}
        while way:
            name, left = way[-1]
            following = next(left, None)
            if following is None:
                way.pop()
                onto.discard(name)
                reads[name] = 1 + sum(reads.get(each, 1) for each in refers[name])
            elif following in refers and following not in reads and following not in onto:
                onto.add(following)
                way.append((following, iter(refers[following])))
    return sum(reads.values())
