"""Databases: what the messages of a bus hold.  cantools reads the DBC, this freezes its layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.can import j1939
from clutchest.can.layout_cache import recalled, remember
from clutchest.errors import ClutchestError, nearest

if TYPE_CHECKING:
    import cantools.database.can as cantools_can


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """Place of a signal in its message, and how its raw value becomes a number.

    ``start`` bit as a DBC counts it (least significant bit if ``little_endian``, else the most
    significant), ``width`` bits; value = raw · ``scale`` + ``offset`` in ``unit``, the bus unit.
    Integers of the DBC stay integers, so that the arithmetic is exact.  ``coded``: the raw value
    may be a J1939 code.  ``multiplexer``: name of the signal that switches this one on, where its
    value is one of ``multiplexer_ids``.
    """

    name: str
    start: int
    width: int
    little_endian: bool = True
    signed: bool = False
    is_float: bool = False
    scale: float = 1
    offset: float = 0
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    multiplexer: str | None = None
    multiplexer_ids: frozenset[int] = frozenset()
    spn: int | None = None
    coded: bool = False

    @property
    def first_bit(self) -> int:
        """Position of the first bit in the order of transmission (big endian) or of weight."""
        byte, bit = divmod(self.start, 8)
        return self.start if self.little_endian else 8 * byte + 7 - bit

    @property
    def last_byte(self) -> int:
        """Index of the last payload byte that the signal touches."""
        return (self.first_bit + self.width - 1) // 8


@dataclass(frozen=True, slots=True)
class Message:
    """One message: ``id`` without flag bits, ``length`` bytes, ``cycle_time_s`` s or None."""

    name: str
    id: int
    extended: bool
    length: int
    is_j1939: bool
    cycle_time_s: float | None
    signals: Mapping[str, SignalLayout]

    def signal(self, name: str) -> SignalLayout:
        """The layout of one signal.  Raises ClutchestError with the nearest names."""
        try:
            return self.signals[name]
        except KeyError:
            raise ClutchestError(
                f"message '{self.name}' has no signal '{name}'" + nearest(name, self.signals)
            ) from None

    @property
    def id_mask(self) -> int:
        """The id bits by which a frame is known as this message: with J1939 only its PGN."""
        return j1939.pgn_mask(self.id) if self.is_j1939 else 0x1FFFFFFF


@dataclass(frozen=True, slots=True)
class Database:
    """The messages of one or more DBC files; ``warnings``: what was tolerated."""

    messages: Mapping[str, Message]
    paths: tuple[Path, ...] = ()
    warnings: tuple[str, ...] = ()

    def message(self, name: str) -> Message:
        """One message by name.  Raises ClutchestError with the nearest names."""
        try:
            return self.messages[name]
        except KeyError:
            files = ", ".join(path.name for path in self.paths) or "the DBC"
            raise ClutchestError(
                f"no message '{name}' in {files}" + nearest(name, self.messages)
            ) from None

    def find(self, can_id: int, extended: bool) -> Message | None:
        """The message that a frame with this id carries (J1939: by PGN), None if unknown."""
        for message in self.messages.values():
            if extended == message.extended and not (can_id ^ message.id) & message.id_mask:
                return message
        return None


def load(paths: Sequence[Path]) -> Database:
    """The messages of all files; of a name that occurs twice the first holds, with a warning.

    Raises ClutchestError naming file and line for a DBC that cantools refuses.
    """
    messages: dict[str, Message] = {}
    warnings: list[str] = []
    for path in paths:
        for message in _load_one(Path(path), warnings):
            if message.name in messages:
                warnings.append(f"{path}: message '{message.name}' is already known, ignored here")
            else:
                messages[message.name] = message
    return Database(messages, tuple(Path(p) for p in paths), tuple(warnings))


def _load_one(path: Path, warnings: list[str]) -> list[Message]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ClutchestError(f"{path}: cannot be read ({error.strerror})") from None
    this = Path(__file__)
    known = _of_plain(recalled(content, this))
    messages, complaint = known or _read(path, content)
    if known is None:
        remember(content, this, _plain(messages, complaint))
    if complaint:
        warnings.append(f"{path}: {complaint}")
    return messages


def _plain(messages: Sequence[Message], complaint: str) -> dict[str, Any]:
    """What was read of a DBC, as JSON can hold it."""
    plain = []
    for message in messages:
        signals = [
            {**asdict(signal), "multiplexer_ids": sorted(signal.multiplexer_ids)}
            for signal in message.signals.values()
        ]
        plain.append({**asdict(message), "signals": signals})
    return {"complaint": complaint, "messages": plain}


def _of_plain(given: Any) -> tuple[list[Message], str] | None:
    """What :func:`_plain` was made of; None if it is nothing of that kind."""
    try:
        messages = []
        for message in given["messages"]:
            signals = [
                SignalLayout(**{**signal, "multiplexer_ids": frozenset(signal["multiplexer_ids"])})
                for signal in message["signals"]
            ]
            named = {signal.name: signal for signal in signals}
            messages.append(Message(**{**message, "signals": named}))
        return messages, str(given["complaint"])
    except (TypeError, KeyError):
        return None


def _read(path: Path, content: bytes) -> tuple[list[Message], str]:
    """The messages as cantools has them, and what it would have refused."""
    import cantools.database
    from textparser import ParseError, TokenizeError

    complaint = ""
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = content.decode("cp1252", "replace")  # what most DBC editors write

    def parsed(strict: bool) -> cantools_can.Database:
        database = cantools.database.can.Database(strict=strict)
        database.add_dbc_string(text)
        return database

    try:
        try:
            database = parsed(strict=True)
        except cantools.database.Error as error:  # overlapping signals and the like
            database = parsed(strict=False)
            complaint = f"{error} Loaded without that check."
    except ParseError as error:
        line = text.splitlines()[error.line - 1].strip()
        raise ClutchestError(
            f"{path}, line {error.line}, column {error.column}: not valid in a DBC: {line[:80]!r}"
        ) from None
    except TokenizeError as error:
        number = text.count("\n", 0, error.offset) + 1
        line = text.splitlines()[number - 1].strip()
        raise ClutchestError(f"{path}, line {number}: not valid in a DBC: {line[:80]!r}") from None
    except Exception as error:  # cantools lets its own lookups fail on a broken file
        raise ClutchestError(
            f"{path}: not a DBC that can be read ({type(error).__name__}: {error})"
        ) from None
    if not database.messages:
        raise ClutchestError(f"{path}: no messages; expected a DBC with BO_ lines")
    attributes = database.dbc.attributes if database.dbc else {}
    protocol = attributes.get("ProtocolType")
    bus_is_j1939 = protocol is not None and str(protocol.value).upper() == "J1939"
    return [_message(message, bus_is_j1939) for message in database.messages], complaint


def _message(message: Any, bus_is_j1939: bool) -> Message:
    extended = bool(message.is_extended_frame)
    is_j1939 = extended and (message.protocol == "j1939" or bus_is_j1939)
    signals = {signal.name: _signal(signal, is_j1939) for signal in message.signals}
    cycle = message.cycle_time
    return Message(
        message.name,
        message.frame_id,
        extended,
        message.length,
        is_j1939,
        cycle / 1000 if cycle else None,
        signals,
    )


def _signal(signal: Any, is_j1939: bool) -> SignalLayout:
    is_float = bool(signal.conversion.is_float)
    # Counters and checksums run through every code.
    coded = (
        is_j1939
        and not signal.is_signed
        and not is_float
        and signal.length > 1
        and not signal.name.endswith(("Counter", "Checksum"))
    )
    return SignalLayout(
        name=signal.name,
        start=signal.start,
        width=signal.length,
        little_endian=signal.byte_order == "little_endian",
        signed=bool(signal.is_signed),
        is_float=is_float,
        scale=signal.scale,
        offset=signal.offset,
        unit=signal.unit or "",
        minimum=signal.minimum,
        maximum=signal.maximum,
        multiplexer=signal.multiplexer_signal,
        multiplexer_ids=frozenset(signal.multiplexer_ids or ()),
        spn=signal.spn,
        coded=coded,
    )
