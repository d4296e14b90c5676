"""A DBC of which cantools refuses a part: the rest of it, and what was left out and why."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from clutchest.budgets import LARGEST, LONGEST_RANGE, MESSAGE_BITS, REPAIRED_BYTES
from clutchest.can.log_source import quiet

if TYPE_CHECKING:
    from cantools.database.can import Database

_MOST = 200  # repairs of one file
_KEYWORD = re.compile(
    r"\s*(VERSION|NS_|BS_|BU_|VAL_TABLE_|BO_|SG_|BO_TX_BU_|EV_|ENVVAR_DATA_|CM_|BA_DEF_DEF_|"
    r"BA_DEF_REL_|BA_DEF_|BA_REL_|BA_|VAL_|SIG_VALTYPE_|SIG_GROUP_|SG_MUL_VAL_|SGTYPE_)(?=[\s:])"
)
_MESSAGE = re.compile(r"\s*BO_\s+(?P<id>\d+)\s+(?P<name>\w+)\s*:")
_SIGNAL = re.compile(r"\s*SG_\s+(?P<name>\w+)")
# One that no multiplexer switches on.
_PLAIN_SIGNAL = re.compile(r"\s*SG_\s+(?P<name>\w+)\s*:[^(\"]*\((?P<zero>\s*[-+]?0+(?:\.0*)?\s*,)?")
# What refers to a message or to one of its signals by the message's id.
_REFERENCE = re.compile(
    r"\s*(?:CM_\s+SG_|CM_\s+BO_|BA_\s+\"[^\"]*\"\s+SG_|BA_\s+\"[^\"]*\"\s+BO_|VAL_|SIG_VALTYPE_|"
    r"SG_MUL_VAL_|SIG_GROUP_|BO_TX_BU_)\s+(?P<id>\d+)\s*:?\s*(?P<signal>[A-Za-z_]\w*)?"
)
_OF_SIGNALS = re.compile(r"\s*(CM_\s+SG_|BA_\s+\"[^\"]*\"\s+SG_|VAL_|SIG_VALTYPE_|SG_MUL_VAL_)\s")
_PLACE = re.compile(r"\bSG_\s+[^:\"]*:\s*(\d+)\s*\|\s*(\d+)\s*@[^(\"]*(\([^)\"]*)")
_LENGTH = re.compile(r"\bBO_\s[^:\"]*:\s*(\d+)")
_RANGES = re.compile(r"\bSG_MUL_VAL_\s[^;\"]*")
_RANGE = re.compile(r"(\d+)\s*-\s*(\d+)")
# Numbers of thousands of digits: to write one out takes hours.
_LONG_NUMBER = r"[-+]?(?:\d[\d.]*[eE]\+?\d{4,}|\d{400,})"
_ENDLESS = re.compile(rf"(?<![\w.]){_LONG_NUMBER}")
_ENDLESS_WORD = re.compile(rf'"\s*{_LONG_NUMBER}\s*"')  # the value of an attribute
_WORDS = re.compile(r'"[^"]*"')
_DIGITS, _LONGEST_NUMBER, _LONG = 9, 310, 1 << 20
_EXTENDED = 1 << 31
# Lines that end before the sender of a message, or the receivers of a signal.
_NO_SENDER = re.compile(r"^([ \t]*BO_[ \t]+\d+[ \t]+\w+[ \t]*:[ \t]*\d+)[ \t\r]*$", re.MULTILINE)
_NO_RECEIVER = re.compile(
    r"^([ \t]*SG_[ \t][^\"\n]*\"[^\"\n]*\")[ \t\r]*$(?=\n[ \t\r]*\n|\n[ \t]*[A-Z]+_|\n?\Z)",
    re.MULTILINE,
)
_NOBODY = r"\1 Vector__XXX"
_STRANGE = re.compile(r"\s*[A-Z][A-Z_]*_(?=[\s:])")  # shaped like a keyword
_DEFINED = re.compile(r"\s*BA_DEF_(?:REL_)?\s+(?:[A-Z_]+_\s+)?\"(?P<name>[^\"]*)\"")
_ATTRIBUTE = re.compile(r"\s*(?:BA_DEF_DEF_|BA_DEF_DEF_REL_|BA_|BA_REL_)\s+\"(?P<name>[^\"]*)\"")
_SIGNALS_OF_NO_MESSAGE = "VECTOR__INDEPENDENT_SIG_MSG"
_INVALID = "not valid in a DBC"


class Irreparable(Exception):
    """Nothing of the file can be used; ``line`` where it is wrong, 0 if that is not known."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(why)
        self.line = line


@dataclass
class _Text:
    """The lines of a DBC, the ones left out empty, so that numbers of lines stay."""

    lines: list[str]
    complaints: list[str] = field(default_factory=list)

    def statement(self, line: int) -> tuple[int, int]:
        """First line and the one behind the last of what stands at ``line``, from 0."""
        first = min(line, len(self.lines) - 1)
        while first > 0 and not _STRANGE.match(self.lines[first]) and not self._begins(first):
            first -= 1
        is_message = bool(re.match(r"\s*BO_\s", self.lines[first]))
        end = first + 1
        while end < len(self.lines):
            keyword = _KEYWORD.match(self.lines[end])
            if keyword and not (is_message and keyword[1] == "SG_"):
                break
            end += 1
        return first, end

    def _begins(self, line: int) -> bool:
        return bool(_KEYWORD.match(self.lines[line]))

    def leave_out(self, line: int, why: str) -> None:
        """Empty the statement at ``line``; a message goes with its signals."""
        first, end = self.statement(line)
        words = self.lines[first].strip()[:60]
        known = self._begins(first) or _STRANGE.match(self.lines[first])
        if not known or words.startswith(("VERSION", "NS_", "BS_")):
            raise Irreparable(line + 1, why)
        self.complaints.append(f"line {line + 1}: {words!r} left out: {why}")
        self.lines[first:end] = [""] * (end - first)

    def message_line(self, name: str) -> int | None:
        """The line of a message, by its name."""
        for number, line in enumerate(self.lines):
            match = _MESSAGE.match(line)
            if match and match["name"] == name:
                return number
        return None

    def make_extended(self, number: int) -> bool:
        """Mark the id of the message at this line as one of 29 bits, wherever it is referred to."""
        match = _MESSAGE.match(self.lines[number])
        if match is None or int(match["id"]) >= 1 << 29:
            return False
        old, new = match["id"], str(int(match["id"]) | _EXTENDED)
        for k, line in enumerate(self.lines):
            refers = _MESSAGE.match(line) or _REFERENCE.match(line)
            if refers and refers["id"] == old:
                self.lines[k] = line[: refers.start("id")] + new + line[refers.end("id") :]
        self.complaints.append(
            f"line {number + 1}: message '{match['name']}': id {old} has more than 11 bits and is "
            "not marked as extended; taken as one of 29 bits"
        )
        return True

    def accept(self, why: str, strict: bool) -> bool:
        """Change or leave out the message that cantools refuses: an id of too many bits, signals
        that overlap.  Whether to be strict from now on."""
        named = re.search(r"in message (\w+)", why)
        number = self.message_line(named[1]) if named else None
        if number is not None and "frame id" in why:
            if "Standard" not in why or not self.make_extended(number):
                self.leave_out(number, why)
        elif (signal := self._signal_line(number, why)) is not None:
            self.leave_out(signal, why)
        elif strict:
            self.complaints.append(f"{why} Loaded without that check.")
            return False
        elif number is not None:
            self.leave_out(number, why)
        else:
            raise Irreparable(0, why)
        return strict

    def _signal_line(self, message: int | None, why: str) -> int | None:
        """The line of the signal that is wrong by itself, not by where it lies."""
        named = re.match(r"The signal (\w+) length", why)
        if message is None or named is None:
            return None
        for number in range(message + 1, self.statement(message)[1]):
            signal = _SIGNAL.match(self.lines[number])
            if signal and signal["name"] == named[1]:
                return number
        return None

    def leave_out_giants(self) -> str:
        """Empty messages longer than any, and ranges of more values than cantools may write out;
        the text that is left."""
        bare = _without_words("\n".join(self.lines))
        for length in _LENGTH.finditer(bare):
            if not _at_most(length[1], MESSAGE_BITS // 8):
                self._leave_out(length, f"a message has at most {MESSAGE_BITS // 8} bytes")
        values = 0
        for ranges in _RANGES.finditer(bare):
            for low, high in _RANGE.findall(ranges[0]):
                own = int(high) - int(low) + 1 if _at_most(high, LONGEST_RANGE) else LONGEST_RANGE
                values += max(own, 1)
            if values >= LONGEST_RANGE:
                self._leave_out(ranges, "its ranges hold too many values")
                values = 0
        return "\n".join(self.lines) + "\n"

    def _leave_out(self, match: re.Match[str], why: str) -> None:
        number = match.string.count("\n", 0, match.start())
        if self.lines[number]:
            self.leave_out(number, why)

    def leave_out_twins(self) -> None:
        """Empty signals whose name their message has already, and note factors of 0."""
        names: set[str] = set()
        for number, line in enumerate(_without_words("\n".join(self.lines)).split("\n")):
            if _MESSAGE.match(line):
                names = set()
            elif signal := _PLAIN_SIGNAL.match(line):
                if signal["name"] in names:
                    self.leave_out(number, "its message has a signal of this name already")
                names.add(signal["name"])
                if signal["zero"]:
                    self.complaints.append(
                        f"line {number + 1}: signal '{signal['name']}' has the factor 0: it never "
                        "changes"
                    )

    def leave_out_references(self) -> bool:
        """Empty what refers to a message or signal that is not there; whether there was any."""
        known: dict[str, set[str]] = {}
        current: set[str] = set()
        for line in self.lines:
            if message := _MESSAGE.match(line):
                current = known.setdefault(message["id"], set())
            elif signal := _SIGNAL.match(line):
                current.add(signal["name"])
        before = len(self.complaints)
        defined = {found["name"] for line in self.lines if (found := _DEFINED.match(line))}
        for number, line in enumerate(self.lines):
            attribute = _ATTRIBUTE.match(line)
            if attribute and attribute["name"] not in defined:
                self.leave_out(number, f"no attribute '{attribute['name']}' is defined")
                continue
            refers = _REFERENCE.match(line)
            if refers is None:
                continue
            if refers["id"] not in known:
                self.leave_out(number, f"no message has the id {refers['id']}")
            elif _OF_SIGNALS.match(line) and refers["signal"] not in known[refers["id"]]:
                self.leave_out(number, f"its message has no signal '{refers['signal']}'")
        return len(self.complaints) > before

    def note_lost(self, database: Database) -> None:
        """What cantools did not take and did not refuse, as at the end of a file that is cut."""
        held = {(m.frame_id, bool(m.is_extended_frame)): m for m in database.messages}
        of: list[tuple[int, str]] = []  # signals of the message at hand
        message, known = -1, None
        bare = _without_words("\n".join(self.lines)).split("\n")
        for number, line in enumerate([*bare, f"BO_ 0 {_SIGNALS_OF_NO_MESSAGE}:"]):
            if begun := _MESSAGE.match(line):
                self._note_signals(of, known)
                message, of = number, []
                given = int(begun["id"])
                known = held.get((given & ~_EXTENDED, bool(given & _EXTENDED)))
                if known is None and begun["name"] != _SIGNALS_OF_NO_MESSAGE:
                    self._note(message)
            elif (signal := _SIGNAL.match(line)) and known is not None:
                of.append((number, signal["name"]))

    def _note_signals(self, lines: list[tuple[int, str]], message: Any) -> None:
        names = set() if message is None else {signal.name for signal in message.signals}
        if message is not None and len(lines) > len(message.signals):
            for number, name in lines:
                if name not in names:
                    self._note(number)

    def _note(self, number: int) -> None:
        words = self.lines[number].strip()[:60]
        self.complaints.append(f"line {number + 1}: {words!r} left out: {_INVALID}")


def _check_numbers(text: str) -> None:
    """Raises Irreparable for places and numbers beyond any message, and for a long text whose
    quotes do not close: what cantools does with them takes all memory."""
    bare = _without_words(text)
    for endless in (_ENDLESS.search(bare), _ENDLESS_WORD.search(text)):
        if endless:
            words = endless[0].strip('" ')[:20]
            line = text.count("\n", 0, endless.start()) + 1
            raise Irreparable(line, f"the number {words}, expected at most {LARGEST:g}")
    for place in _PLACE.finditer(bare):
        number = bare.count("\n", 0, place.start()) + 1
        if not all(_at_most(digits, MESSAGE_BITS) for digits in place.group(1, 2)):
            raise Irreparable(number, f"a signal begins and ends within {MESSAGE_BITS} bits")
        for words in re.findall(r"[-+.\w]+", place[3]):
            if len(words) > _LONGEST_NUMBER or not _fits(words):
                raise Irreparable(
                    number, f"scale or offset {words[:20]}, expected at most {LARGEST:g}"
                )
    if len(text) > _LONG and text.count('"') % 2:
        raise Irreparable(text.count("\n", 0, text.rindex('"')) + 1, "a quote that does not close")


def _at_most(digits: str, most: int) -> bool:
    """Whether a whole number, of however many digits, is not larger."""
    return len(digits) <= _DIGITS and int(digits) <= most


def _without_words(text: str) -> str:
    """A text with blanks instead of what is quoted, so that places in it stay."""
    return _WORDS.sub(lambda words: '"' + re.sub(r"[^\n]", " ", words[0][1:-1]) + '"', text)


def _fits(number: str) -> bool:
    try:
        return abs(float(number)) <= LARGEST
    except ValueError:  # no number, which cantools says
        return True


def parsed(text: str) -> tuple[Database, list[str]]:
    """The database, and in words what was left out of it or tolerated.

    Raises Irreparable.
    """
    import cantools.database
    from textparser import ParseError, TokenizeError

    if not text.strip():
        raise Irreparable(0, "the file is empty; expected a DBC, ARXML, KCD or SYM")
    text = _NO_RECEIVER.sub(_NOBODY, _NO_SENDER.sub(_NOBODY, text))
    given, strict = _Text(text.splitlines()), True
    given.leave_out_twins()
    most = min(_MOST, REPAIRED_BYTES // max(len(text), 1) + 2)
    with quiet("cantools"):
        for _ in range(most):
            whole = given.leave_out_giants()
            _check_numbers(whole)
            database = cantools.database.can.Database(strict=strict)
            try:
                database.add_dbc_string(whole)
                given.note_lost(database)
                return database, given.complaints
            except ParseError as error:
                given.leave_out(error.line - 1, _INVALID)
            except TokenizeError as error:
                given.leave_out(whole.count("\n", 0, error.offset), _INVALID)
            except cantools.database.Error as error:
                strict = given.accept(" ".join(str(error).split()), strict)
            except Exception as error:  # cantools lets its own lookups fail
                if not given.leave_out_references():
                    why = f"not a DBC that can be read ({type(error).__name__}: {error})"
                    raise Irreparable(0, why) from None
    raise Irreparable(0, f"more than {most} lines are not valid")
