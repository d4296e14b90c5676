"""Layouts of a DBC that this machine has read before: loading cantools, and with it python-can and
all that this brings along, takes longer than many a replay."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from clutchest import __version__
from clutchest.cache import cache_folder, kept
from clutchest.can.database import Message, SignalLayout

Read = tuple[list[Message], str]  # the messages, and what cantools complained of, if anything


def recalled(content: bytes) -> Read | None:
    """What was read of a DBC with this ``content``; None if nothing is known of it."""
    try:
        given = json.loads(_place(content).read_text(encoding="utf-8"))
        return [_message(message) for message in given["messages"]], str(given["complaint"])
    except (OSError, ValueError, TypeError, KeyError):
        return None  # not there, or not whole: it is read anew


def remember(content: bytes, messages: Sequence[Message], complaint: str) -> None:
    """Keep what was read, where the disk allows it."""
    place = _place(content)
    told = {"complaint": complaint, "messages": [_plain(message) for message in messages]}
    with suppress(OSError, TypeError, ValueError):  # full disk; what JSON has no words for
        place.unlink(missing_ok=True)
        place.parent.mkdir(parents=True, exist_ok=True)
        kept(place.parent, place.name, json.dumps(told))


def _place(content: bytes) -> Path:
    """The file's name changes with what is in the DBC and with whom it is read by."""
    digest = hashlib.sha256(content)
    digest.update(f"{__version__} {version('cantools')}".encode())
    digest.update(Path(__file__).with_name("database.py").read_bytes())
    return cache_folder() / f"dbc_{digest.hexdigest()[:24]}.json"


def _plain(message: Message) -> dict[str, Any]:
    signals = [
        {**asdict(signal), "multiplexer_ids": sorted(signal.multiplexer_ids)}
        for signal in message.signals.values()
    ]
    return {**asdict(message), "signals": signals}


def _message(given: dict[str, Any]) -> Message:
    signals = [
        SignalLayout(**{**signal, "multiplexer_ids": frozenset(signal["multiplexer_ids"])})
        for signal in given["signals"]
    ]
    return Message(**{**given, "signals": {signal.name: signal for signal in signals}})
