"""Decoding against cantools, bit for bit, on layouts and payloads that hypothesis draws."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Message as Reference
from cantools.database.can import Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchest.can.database import Message, SignalLayout, load
from clutchest.can.decode import decode
from clutchest.can.frames import Frames
from clutchest.shipped import shipped
from clutchest.signals import Why

_DATA = Path(__file__).parents[2].parent / "shared" / "data"
DBCS = sorted([*shipped("dbc").values(), *_DATA.glob("*.dbc")])
REFUSED = {"hyundai_can.dbc"}  # by cantools too


def one_frame(payload: bytes) -> Frames:
    frames = Frames.empty(1, 8 if len(payload) <= 8 else 64)
    frames.length[:] = len(payload)
    frames.data[0, : len(payload)] = np.frombuffer(payload, np.uint8)
    return frames


def ours(message: Message, payload: bytes) -> dict[str, tuple[float, int]]:
    """What is decoded: name → (value, why); signals that a multiplexer leaves out are missing."""
    columns = decode(one_frame(payload), np.arange(1), message, list(message.signals))
    return {
        name: (float(column.value[0]), int(column.why[0]))
        for name, column in columns.items()
        if len(column.rows)
    }


def assert_equal(given: tuple[float, int], expected: float | None, layout: SignalLayout) -> None:
    value, why = given
    if expected is None:
        assert why == Why.TOO_SHORT and np.isnan(value)
    elif layout.coded and why in (Why.NOT_AVAILABLE, Why.ERROR, Why.RESERVED):
        assert np.isnan(value)
    elif not np.isfinite(expected):
        assert why == Why.OUT_OF_RANGE and np.isnan(value)
    else:
        assert why == Why.VALID and value == expected, layout


@st.composite
def layouts(draw) -> SignalLayout:
    is_float = draw(st.booleans())
    width = draw(st.sampled_from([16, 32, 64])) if is_float else draw(st.integers(1, 64))
    little = draw(st.booleans())
    first = draw(st.integers(0, 512 - width))
    start = first if little else 8 * (first // 8) + 7 - first % 8
    numbers = st.one_of(st.integers(-1000, 1000), st.floats(-1e3, 1e3, allow_nan=False))
    scale = draw(numbers.filter(bool))
    return SignalLayout(
        "S", start, width, little, draw(st.booleans()), is_float, scale, draw(numbers)
    )


@given(layouts(), st.binary(max_size=64))
@settings(max_examples=200, deadline=None)
def test_any_layout_in_a_frame_of_any_length(layout, payload):
    conversion = BaseConversion.factory(layout.scale, layout.offset, None, layout.is_float)
    signal = Signal(
        "S",
        layout.start,
        layout.width,
        "little_endian" if layout.little_endian else "big_endian",
        layout.signed,
        conversion=conversion,
    )
    reference = Reference(1, "M", 64, [signal])
    message = Message("M", 1, False, 64, False, None, {"S": layout})
    values = reference.decode(payload, allow_truncated=True)
    expected = float(values["S"]) if "S" in values else None  # cantools counts without end
    assert_equal(ours(message, payload)["S"], expected, layout)


@cache
def both(path: Path) -> list[tuple[Reference, Message]]:
    """The messages of a DBC that cantools itself can place, in cantools and here."""
    database, reference = load([path]), cantools.database.load_file(path, strict=False)
    pairs = []
    for message in reference.messages:
        try:
            message.refresh(strict=True)
        except cantools.database.Error:
            continue
        switches = {s.multiplexer_signal for s in message.signals} - {None}
        if all(message.get_signal_by_name(name).is_multiplexer for name in switches):
            pairs.append((message, database.message(message.name)))
    return pairs


@pytest.mark.parametrize("path", DBCS, ids=lambda path: path.name)
@given(drawn=st.data())
@settings(max_examples=60, deadline=None)
def test_every_dbc_with_frames_of_any_length(path, drawn):
    if path.name in REFUSED:
        with pytest.raises(cantools.database.Error):
            cantools.database.load_file(path, strict=False)
        return
    reference, message = drawn.draw(st.sampled_from(both(path)))
    shortest, longest = max(0, message.length - 3), min(64, message.length + 3)
    payload = drawn.draw(st.binary(min_size=shortest, max_size=longest))
    try:
        values = reference.decode(
            payload, decode_choices=False, allow_truncated=True, allow_excess=True
        )
    except cantools.database.DecodeError:
        return  # a value of a multiplexer that switches nothing on
    given = ours(message, payload)
    for name, value in values.items():
        assert_equal(given[name], float(value), message.signals[name])
    for name in set(given) - set(values):  # cut off
        assert given[name][1] == Why.TOO_SHORT, name


def test_all_dbcs_have_been_looked_at():
    assert sum(len(both(path)) for path in DBCS if path.name not in REFUSED) > (
        400 if len(DBCS) > 2 else 5
    )
