"""What a replay says it was told: bits by mode and slip event, partners, and what would help."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import clutchest
from clutchest.estimate.observability import (
    NOTHING,
    Information,
    between_engagements,
    needs,
    not_observable_now,
)
from clutchest.models import machine_of
from clutchest.models.regimes import MODE_NAMES, Mode

TRUCK = clutchest.load_vehicle("truck")
STATES = {state.name: state for state in machine_of("dry_clutch").states}


@pytest.fixture(scope="module")
def launches():
    return clutchest.replay(clutchest.simulate(TRUCK, "launches", 1, duration=400.0), TRUCK)


@pytest.fixture(scope="module")
def closed():
    return clutchest.replay(clutchest.simulate(TRUCK, "closed", 1), TRUCK)


def bits(run, name):
    return run.summary["states"][name]["information_bits"]


def test_each_state_is_told_in_the_mode_that_shows_it(launches):
    assert (
        bits(launches, "zero_position")["retracted"]
        > 0.9 * bits(launches, "zero_position")["total"]
    )
    assert bits(launches, "friction")["slipping"] > 0.75 * bits(launches, "friction")["total"]
    assert bits(launches, "torque_bias")["open"] > 0.5 * bits(launches, "torque_bias")["total"]
    assert bits(launches, "friction")["slipping"] > 1.0
    assert bits(launches, "temp_housing")["total"] < 0.2 * bits(launches, "temp_body")["total"]


def test_the_pieces_add_up(launches):
    summary = launches.summary
    events = [event["information_bits"] for event in summary["engagements"]]
    others = [
        mode["information_bits"]
        for piece in summary["between_engagements"]
        for mode in piece["modes"].values()
    ]
    assert len(events) >= 5 and len(others) >= len(events)
    for name in STATES:
        total = bits(launches, name)["total"]
        assert sum(piece[name] for piece in events + others) == pytest.approx(total, abs=1e-9)
        by_mode = sum(value for mode, value in bits(launches, name).items() if mode != "total")
        assert by_mode == pytest.approx(total)
    # and so do their times
    span = sum(e["duration_s"] for e in summary["engagements"])
    span += sum(p["duration_s"] for p in summary["between_engagements"])
    time = launches.tracks[0].information.time
    assert span == pytest.approx(time[-1] - time[0], abs=1e-6)
    seconds = sum(m["seconds"] for p in summary["between_engagements"] for m in p["modes"].values())
    outside = sum(piece["duration_s"] for piece in summary["between_engagements"])
    assert seconds == pytest.approx(outside, abs=1e-6)


def test_without_slip_nothing_is_told_of_friction(closed):
    for name in ("friction", "wear_rate", "torque_bias"):
        told = closed.summary["states"][name]
        assert told["information_bits"]["total"] == 0.0
        assert told["informed_at_s"] is None
        assert told["not_observable_now"].startswith("not observable: no information in this drive")
        assert told["why"] == "nothing in this log informs it"
        assert told["needs"] == STATES[name].informed_by
    assert bits(closed, "zero_position")["retracted"] > 1.0


def test_since_when_friction_is_not_observable(launches):
    told = launches.summary["states"]["friction"]
    last = launches.tracks[0].engagements[-1]
    end = launches.tracks[0].time[-1]
    assert told["valid"] and told["needs"] is None
    assert last.start_s <= told["informed_at_s"] <= end
    if end - told["informed_at_s"] > 10.0:
        since = f"since {told['informed_at_s']:.0f} s"
        assert told["not_observable_now"].endswith(since)
    assert launches.summary["states"]["engine_speed"]["not_observable_now"] is None


def test_what_informs_does_not_hang_on_the_rate_of_the_output(launches):
    signals = clutchest.simulate(TRUCK, "launches", 1, duration=400.0)
    slow = clutchest.replay(signals, TRUCK, rate=2.0)
    for name in ("zero_position", "friction", "temp_body"):
        assert bits(slow, name)["total"] == pytest.approx(bits(launches, name)["total"], rel=0.1)


def test_partners_are_those_of_the_covariance_with_the_spreads_in_it(launches):
    final = json.loads(json.dumps(launches.final))
    spread = np.array([TRUCK.parameters[key].spread for _, key in final["thetas"]])
    S = np.array(final["signature"]) * spread
    P = np.array(final["P"]) + S @ S.T
    i, j = (final["states"].index(name) for name in ("temp_body", "zero_position"))
    correlation = P[i, j] / np.sqrt(P[i, i] * P[j, j])
    assert correlation < -0.9
    states = launches.summary["states"]
    assert states["temp_body"]["moves_with"]["zero_position"] == pytest.approx(correlation)
    assert next(iter(states["zero_position"]["moves_with"])) == "temp_body"
    assert not states["friction"]["moves_with"]


def test_what_would_tell_a_pair_apart():
    alone = needs(TRUCK.machine, STATES["temp_body"], {})
    assert alone == STATES["temp_body"].informed_by
    pair = needs(TRUCK.machine, STATES["temp_body"], {"zero_position": -0.97})
    assert pair == (
        "slow cooling with the actuator retracted: it separates body temperature from zero position"
    )
    for separation in TRUCK.machine.separating_manoeuvres:
        assert set(separation.pair) <= set(STATES) and separation.by


def test_where_the_signals_show_no_state_there_are_no_bits():
    signals = clutchest.simulate(TRUCK, "launches", 1, duration=60.0)
    blind = replace(signals, signals={n: s for n, s in signals.items() if n != "slave_position"})
    run = clutchest.replay(blind, TRUCK)
    told = run.summary["states"]["friction"]
    assert told["why"] == "no slave position signal"
    assert told["information_bits"] is None and told["needs"]
    assert run.summary["wear"] is None
    assert "friction" not in run.tracks[0].information.names
    unturned = {n: s for n, s in signals.items() if n != "input_shaft_speed"}
    run = clutchest.replay(replace(signals, signals=unturned), TRUCK)
    assert run.summary["states"]["friction"]["why"].startswith("no input shaft speed signal")


def of(bits, mode, time=None):
    bits = np.array(bits, float)[:, None]
    time = np.arange(len(bits), dtype=float) if time is None else np.array(time)
    return Information(("friction",), time, np.array(mode, np.uint8), bits, MODE_NAMES)


def test_pieces_by_hand():
    slip, home = int(Mode.slipping), int(Mode.retracted)
    told = of([0.5, 1.0, 2.0, 0.25, 0.0], [home, slip, slip, home, home])
    assert told.total() == {"friction": 3.75}
    assert told.by_mode()["slipping"] == {"friction": 3.0}
    assert told.between(0.0, 2.0).total() == {"friction": 3.0}  # intervals ending at 1 and 2 s
    pieces = between_engagements(told, [(0.0, 2.0)])
    assert [(p["start_s"], p["duration_s"]) for p in pieces] == [(0.0, 0.0), (2.0, 2.0)]
    assert pieces[1]["modes"] == {
        "retracted": {"seconds": 2.0, "information_bits": {"friction": 0.25}}
    }


def test_when_a_state_was_last_informed():
    slip, home = int(Mode.slipping), int(Mode.retracted)
    many = of([NOTHING / 5] * 20, [slip] * 20)  # little by little: the last five make it
    assert many.informed_at("friction") == 15.0
    assert of([NOTHING / 5] * 4, [slip] * 4).informed_at("friction") is None
    away = of([1.0, 0.0, 0.0], [slip, home, home], [0.0, 10.0, 20.0])
    assert not_observable_now(away, away.by_mode(), "friction") == (
        "not observable now: no information since 0 s"
    )
    still = of([1.0, 0.0, 0.0], [slip, home, slip], [0.0, 10.0, 20.0])
    assert not_observable_now(still, still.by_mode(), "friction") is None
