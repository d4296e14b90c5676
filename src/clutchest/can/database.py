"""Databases: what the messages of a bus hold.  cantools reads the DBC, this freezes its layout."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.budgets import DBC_BYTES, within
from clutchest.can import j1939
from clutchest.can.layout_cache import recalled, remember
from clutchest.can.log_source import utf16_of
from clutchest.errors import ClutchestError, nearest
from clutchest.shipped import locate

if TYPE_CHECKING:
    import cantools.database.can as cantools_can

_HEAD = 1 << 16  # characters in which the kind of a database shows
# What is read of a DBC depends on these.
_READERS = [
    Path(__file__).parent / name
    for name in ("database.py", "j1939.py", "recovery/dbc.py", "recovery/places.py")
]


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """Place of a signal in its message, and how its raw value becomes a number.

    ``start`` bit as a DBC counts it (least significant bit if ``little_endian``, else the most
    significant), ``width`` bits; value = raw · ``scale`` + ``offset`` in ``unit``, the bus unit.
    Integers of the DBC stay integers, so that the arithmetic is exact.  ``coded``: the raw value
    may be a J1939 code.  ``multiplexer``: name of the signal that switches this one on, where its
    value is one of ``multiplexer_ids``; ``branches``: the same signal where it lies elsewhere in
    other branches of the multiplexer.
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
    branches: tuple[SignalLayout, ...] = ()

    def with_branch(self, other: SignalLayout) -> SignalLayout:
        """This signal, which has the ``other`` layout in another branch of its multiplexer."""
        for k, layout in enumerate((self, *self.branches)):
            here = replace(layout, multiplexer_ids=other.multiplexer_ids, branches=())
            if here == other:
                ids = layout.multiplexer_ids | other.multiplexer_ids
                if k == 0:
                    return replace(self, multiplexer_ids=ids)
                merged = replace(layout, multiplexer_ids=ids)
                return replace(self, branches=(*self.branches[: k - 1], merged, *self.branches[k:]))
        return replace(self, branches=(*self.branches, other))

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
    """One message: ``id`` without flag bits, ``length`` bytes, ``cycle_time_s`` s or None.

    ``channel`` on which frames are this message, None for any.
    """

    name: str
    id: int
    extended: bool
    length: int
    is_j1939: bool
    cycle_time_s: float | None
    signals: Mapping[str, SignalLayout]
    channel: int | None = None

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

    def on(self, channel: int) -> bool:
        """Whether frames of a channel may be this message."""
        return self.channel is None or self.channel == channel


@dataclass(frozen=True, slots=True)
class DatabaseFile:
    """A database, and the ``channel`` whose frames it describes, None for those of every one."""

    path: Path
    channel: int | None = None

    def __str__(self) -> str:
        return str(self.path) if self.channel is None else f"{self.path} (channel {self.channel})"


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
            own = [key for key in self.messages if key.rpartition("@")[0] == name]
            if own:
                raise ClutchestError(
                    f"message '{name}' is in the databases of several channels; expected "
                    + " or ".join(own)
                ) from None
            raise ClutchestError(
                f"no message '{name}' in {files}" + nearest(name, self.messages)
            ) from None

    def find(self, can_id: int, extended: bool, channel: int | None = None) -> Message | None:
        """The message that a frame with this id carries (J1939: by PGN), on a ``channel`` if one is
        given; None if unknown."""
        for message in self.messages.values():
            same = extended == message.extended and not (can_id ^ message.id) & message.id_mask
            if same and (channel is None or message.on(channel)):
                return message
        return None


def located(given: str | Path | DatabaseFile) -> DatabaseFile:
    """The file of a database, which may be a shipped one by its name (``hdt_clutch``)."""
    file = given if isinstance(given, DatabaseFile) else DatabaseFile(Path(given))
    return replace(file, path=locate(str(file.path), "dbc"))


def load(given: Sequence[str | Path | DatabaseFile]) -> Database:
    """The messages of all files; of a name that occurs twice the first holds, with a warning.

    A name that the files of different channels have becomes one for each, such as ``EEC1@0`` and
    ``EEC1@1``.  Raises ClutchestError naming file and line for a DBC that cantools refuses.
    """
    warnings: list[str] = []
    files = [located(each) for each in given]
    read = [
        (file, replace(message, channel=file.channel))
        for file in files
        for message in _load_one(file.path, warnings)
    ]
    channels: dict[str, set[int | None]] = {}
    for file, message in read:
        channels.setdefault(message.name, set()).add(file.channel)
    messages: dict[str, Message] = {}
    for file, message in read:
        name = message.name
        if file.channel is not None and len(channels[name]) > 1:
            name = f"{name}@{file.channel}"
        if name in messages:
            warnings.append(f"{file}: message '{name}' is already known, ignored here")
        else:
            messages[name] = replace(message, name=name)
    return Database(messages, tuple(file.path for file in files), tuple(warnings))


def _load_one(path: Path, warnings: list[str]) -> list[Message]:
    try:
        within(path, DBC_BYTES, "a DBC")
        content = path.read_bytes()
    except OSError as error:
        raise ClutchestError(f"{path}: cannot be read ({error.strerror})") from None
    known = _of_plain(recalled(content, _READERS))
    messages, complaints = known or _read(path, content)
    if known is None:
        remember(content, _READERS, _plain(messages, complaints))
    warnings += [f"{path}: {complaint}" for complaint in complaints]
    return messages


def _plain(messages: Sequence[Message], complaints: Sequence[str]) -> dict[str, Any]:
    """What was read of a DBC, as JSON can hold it."""

    def plain(signal: SignalLayout) -> dict[str, Any]:
        branches = [plain(branch) for branch in signal.branches]
        ids = sorted(signal.multiplexer_ids)
        return {**asdict(signal), "multiplexer_ids": ids, "branches": branches}

    return {
        "complaints": list(complaints),
        "messages": [
            {**asdict(message), "signals": [plain(signal) for signal in message.signals.values()]}
            for message in messages
        ],
    }


def _of_plain(given: Any) -> tuple[list[Message], list[str]] | None:
    """What :func:`_plain` was made of; None if it is nothing of that kind."""

    def signal(plain: dict[str, Any]) -> SignalLayout:
        ids = frozenset(plain["multiplexer_ids"])
        branches = tuple(signal(branch) for branch in plain["branches"])
        return SignalLayout(**{**plain, "multiplexer_ids": ids, "branches": branches})

    try:
        messages = []
        for message in given["messages"]:
            signals = {plain["name"]: signal(plain) for plain in message["signals"]}
            messages.append(Message(**{**message, "signals": signals}))
        return messages, [str(complaint) for complaint in given["complaints"]]
    except (TypeError, KeyError):
        return None


def _text(content: bytes) -> str:
    """The text of a DBC in whatever encoding: by its byte order mark, UTF-8, else Windows'."""
    if encoding := utf16_of(content[:64]):
        return content.decode(encoding, "replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace")  # what most DBC editors write


def _read(path: Path, content: bytes) -> tuple[list[Message], list[str]]:
    """The messages as cantools has them, and what of the file is not valid."""
    from clutchest.can.recovery.dbc import Irreparable, parsed

    text = _text(content)
    try:
        kind = _kind(text)
        database, complaints = parsed(text) if kind == "dbc" else (_other(text, kind), [])
    except Irreparable as error:
        if not error.line:
            raise ClutchestError(f"{path}: {error}") from None
        line = "".join(text.splitlines()[error.line - 1 : error.line]).strip()
        raise ClutchestError(f"{path}, line {error.line}: {error}: {line[:80]!r}") from None
    if not database.messages:
        why = f"; {complaints[0]}" if complaints else ""
        expected = "a DBC with BO_ lines" if kind == "dbc" else f"messages in this {kind.upper()}"
        raise ClutchestError(f"{path}: no messages; expected {expected}{why}")
    is_j1939, assumed = _is_j1939(database)
    if assumed:
        complaints.append(
            "no attribute says that this is J1939, but its ids are those of J1939 parameter "
            "groups: messages are matched by them"
        )
    try:
        messages = [_message(message, is_j1939) for message in database.messages]
    except OverflowError as error:
        raise ClutchestError(f"{path}: a number that cannot be held ({error})") from None
    except (TypeError, ValueError, LookupError, AttributeError) as error:  # attributes of all kinds
        words = " ".join(str(error).split())
        raise ClutchestError(f"{path}: an attribute that cannot be read ({words})") from None
    ids: dict[tuple[int, bool], str] = {}
    for message in messages:
        first = ids.setdefault((message.id, message.extended), message.name)
        if first != message.name:
            complaints.append(f"messages '{first}' and '{message.name}' have the same id")
    return messages, complaints


def _kind(text: str) -> str:
    """The format of a database, by its content: a DBC unless another one shows.

    Raises Irreparable for XML of another kind.
    """
    from clutchest.can.recovery.dbc import Irreparable

    head = text[:_HEAD]
    if head.lstrip().startswith("<"):
        roots = {"AUTOSAR": "arxml", "NetworkDefinition": "kcd"}
        elements = re.findall(r"<(?:[\w.-]+:)?([A-Za-z_][\w.-]*)", head)
        known = next((roots[name] for name in elements if name in roots), None)
        if known is None:
            what = f"<{elements[0][:40]}>" if elements else "XML"
            raise Irreparable(0, f"{what} is no database; expected a DBC, ARXML, KCD or SYM")
        return known
    return "sym" if re.search(r"^\s*FormatVersion\s*=", head, re.MULTILINE) else "dbc"


def _other(text: str, kind: str) -> cantools_can.Database:
    """A database that is no DBC, as cantools reads it.  Raises Irreparable where it does not."""
    from cantools.database import load_string

    from clutchest.can.log_source import quiet
    from clutchest.can.recovery.dbc import Irreparable
    from clutchest.can.recovery.places import check

    check(text, kind)
    try:
        with quiet("cantools"):
            database: Any = load_string(text, database_format=kind, strict=False)
    except Exception as error:  # its parsers raise whatever they meet
        words = " ".join(str(error).split())[:200] or type(error).__name__
        raise Irreparable(0, f"not a readable {kind.upper()}: {words}") from None
    if not hasattr(database, "messages"):  # an ARXML of diagnostics
        raise Irreparable(0, f"this {kind.upper()} describes no messages")
    return database


def _is_j1939(database: cantools_can.Database) -> tuple[bool, bool]:
    """Whether the bus is a J1939 one, and whether only the ids themselves say so."""
    attributes = database.dbc.attributes if database.dbc else {}
    defined = database.dbc.attribute_definitions if database.dbc else {}
    protocol = attributes.get("ProtocolType")
    if protocol is not None:
        return str(protocol.value).upper() == "J1939", False
    if "ProtocolType" in defined or "VFrameFormat" in defined:
        return False, False
    ids = [message.frame_id for message in database.messages if message.is_extended_frame]
    fitting = j1939.fits(ids)
    return fitting, fitting


def _message(message: Any, bus_is_j1939: bool) -> Message:
    extended = bool(message.is_extended_frame)
    is_j1939 = extended and (message.protocol == "j1939" or bus_is_j1939)
    signals: dict[str, SignalLayout] = {}
    for signal in message.signals:
        layout = _signal(signal, is_j1939)
        first = signals.get(layout.name)
        signals[layout.name] = layout if first is None else first.with_branch(layout)
    return Message(
        message.name,
        message.frame_id,
        extended,
        message.length,
        is_j1939,
        _cycle_s(message.cycle_time),
        signals,
    )


def _cycle_s(milliseconds: Any) -> float | None:
    """The period of a message, s; None where its attribute is no period."""
    stated = isinstance(milliseconds, int | float) and 0 < milliseconds < inf
    return milliseconds / 1000 if stated else None


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
        spn=signal.spn if isinstance(signal.spn, int) else None,
        coded=coded,
    )
