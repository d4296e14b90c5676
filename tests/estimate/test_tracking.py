"""Figures of how a torque follows its request: on a made-up response whose figures are known, and
on the generator's rig against its truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from clutchest.estimate.replay import replay
from clutchest.estimate.run import Run, TrackingFigures
from clutchest.estimate.tracking import during, responses
from clutchest.models import machine_of
from clutchest.record.tracking import tracking_head, tracking_note, tracking_rows
from clutchest.signals import Floats, Signal, Signals
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

TRACKING = machine_of("alsd").tracking
ON, DELAY, OFF, FALL, END = 1.0, 0.1, 4.0, 0.2, 6.0  # s
OMEGA, ZETA, HEIGHT = 20.0, 0.4, 1000.0  # rad/s, 1, Nm


def second_order(t: Floats) -> Floats:
    """The step response of ω²/(s² + 2ζωs + ω²)."""
    damped = OMEGA * np.sqrt(1 - ZETA**2)
    lag = np.arccos(ZETA)
    wave = np.exp(-ZETA * OMEGA * t) * np.sin(damped * t + lag) / np.sqrt(1 - ZETA**2)
    return np.where(t < 0, 0.0, 1 - wave)


def made_up(sign: float = 1.0, held: bool = True, ripple: float = 0.0, **more: Floats) -> Signals:
    t = np.arange(0.0, END, 0.002)
    torque = HEIGHT * second_order(t - ON - DELAY) + ripple * np.sqrt(2) * np.sin(60 * np.pi * t)
    torque = np.where(t < OFF, torque, torque * np.clip(1 - (t - OFF) / FALL, 0.0, 1.0))
    torque[t < ON + DELAY] = 0.0
    current = np.where((t >= ON) & (t < OFF), 8.0, 0.0)
    if not held:
        current = np.where(current > 0.0, 1.0 + 3.0 * (t - ON), 0.0)
    given = {"armature_current": current, "clutch_torque": sign * torque, **more}
    return Signals({name: Signal.of(name, "", t, value) for name, value in given.items()}, end=END)


@pytest.fixture(scope="module")
def run() -> Run:
    return replay(
        simulate("alsd_rig", "rig-steps", 3, duration=7.0, nominal=True), "alsd_rig", rate=50.0
    )


def figures(run: Run, signals: Signals, **noise: float) -> tuple[TrackingFigures, ...]:
    return responses(signals, run.tracks[0], TRACKING, noise)


def test_a_drive_without_an_actuation_has_no_figures(run: Run) -> None:
    quiet = made_up()
    still = replace(quiet["armature_current"], value=np.zeros(len(quiet["armature_current"])))
    signals = replace(quiet, signals={**quiet.signals, still.name: still})
    assert figures(run, signals) == ()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_second_order_response(run: Run, sign: float) -> None:
    """Delay, rise, overshoot and settling of a second-order system in closed form."""
    (found,) = figures(run, made_up(sign))
    assert found.start_s == pytest.approx(ON, abs=0.003)
    # 20 Nm of 1000 are reached by ω² t²/2 = 0.02
    assert found.delay_s == pytest.approx(DELAY + np.sqrt(0.04) / OMEGA, abs=0.004)
    t = np.arange(0.0, 2.0, 1e-5)
    step = second_order(t)
    rise = t[np.argmax(step > 0.9)] - t[np.argmax(step > 0.1)]
    assert found.rise_s == pytest.approx(rise, abs=0.002)
    overshoot = np.exp(-np.pi * ZETA / np.sqrt(1 - ZETA**2))
    assert found.overshoot == pytest.approx(overshoot, abs=0.003)
    settling = DELAY + t[np.flatnonzero(np.abs(step - 1) > 0.05)[-1]]
    assert found.settling_s == pytest.approx(settling, abs=0.004)
    assert found.settled == pytest.approx(sign * HEIGHT, rel=1e-3)
    assert found.fall_s == pytest.approx(FALL * (1 - 20.0 / HEIGHT), abs=0.006)
    assert found.error is None


def test_ripple_is_without_the_sensors_noise(run: Run) -> None:
    rng = np.random.default_rng(1)
    signals = made_up(ripple=30.0)
    noisy = replace(signals["clutch_torque"])
    value = noisy.value + 20.0 * rng.standard_normal(len(noisy))
    signals = replace(
        signals, signals={**signals.signals, "clutch_torque": replace(noisy, value=value)}
    )
    (raw,), (found,) = figures(run, signals), figures(run, signals, clutch_torque=20.0)
    assert raw.ripple == pytest.approx(np.hypot(30.0, 20.0), rel=0.05)
    assert found.ripple == pytest.approx(30.0, rel=0.05)


def test_error_and_delay_by_the_request(run: Run) -> None:
    """Where the request is mapped, it says what was wanted, and since when."""
    t = np.arange(0.0, END, 0.002)
    asked = np.where((t >= ON - 0.05) & (t < OFF), 1100.0, 0.0)
    (found,) = figures(run, made_up(torque_request=asked))
    assert found.start_s == pytest.approx(ON - 0.05, abs=0.003)
    assert found.error == pytest.approx(HEIGHT - 1100.0, abs=1.0)
    (plain,) = figures(run, made_up())
    assert found.delay_s - plain.delay_s == pytest.approx(0.05, abs=0.003)


def test_what_is_not_held_has_not_settled(run: Run) -> None:
    (found,) = figures(run, made_up(held=False))
    assert found.delay_s is not None
    assert found.settled is found.overshoot is found.rise_s is found.error is None


def test_no_drive_or_no_declaration_no_figures(run: Run) -> None:
    signals = made_up()
    without = replace(signals, signals={"clutch_torque": signals["clutch_torque"]})
    assert figures(run, without) == ()
    assert responses(signals, run.tracks[0], None, {}) == ()


def test_the_generators_rig(run: Run) -> None:
    """Against the truth: the request of 12, 7 and 2.5 A begins at the first scenario's 0.6 s."""
    truth = run.signals.truth
    assert truth is not None
    t, torque = truth.time, truth.columns["clutch_torque"]
    found = run.tracks[0].responses
    assert len(found) == 3
    sampling = 0.01  # s, of torque and current together
    for response in found:
        pressed = (t > response.start_s) & (t < response.release_s)
        onset = t[pressed][np.argmax(torque[pressed] > TRACKING.onset)]
        assert response.delay_s == pytest.approx(onset - response.start_s, abs=sampling)
        settled = torque[(t > response.release_s - 0.2) & (t < response.release_s)].mean()
        assert response.settled == pytest.approx(settled, rel=0.02)
        assert response.peak == pytest.approx(torque[pressed].max(), rel=0.02)
    assert found[0].start_s == pytest.approx(0.6, abs=0.006)
    delays = [response.delay_s for response in found]
    assert delays == sorted(delays)  # A2: shorter for a larger request
    assert found[0].overshoot > 0.15  # A3


def test_estimated_where_no_sensor_is(run: Run) -> None:
    """Without a torque sensor the estimated torque gives the figures, in its own rows."""
    signals = replace(run.signals, signals={"armature_current": run.signals["armature_current"]})
    found = figures(run, signals)
    assert found
    assert not any(response.measured for response in found)
    assert found[0].resolution_s == pytest.approx(0.02, abs=1e-4)
    settled = run.tracks[0].responses[0].settled
    assert found[0].settled == pytest.approx(settled, rel=0.03)


def test_files(run: Run) -> None:
    """``summary.json`` has them per slip event and by themselves, the report as a table."""
    events, alone = run.summary["engagements"], run.summary["tracking"]
    assert len(alone) == 3
    assert {"delay_s", "rise_s", "overshoot", "settling_s", "error_Nm"} <= set(events[0])
    assert events[0]["delay_s"] == alone[0]["delay_s"]
    rows = tracking_rows(run)
    assert len(rows) == 3
    assert all(len(row) == len(tracking_head(run)) for row in rows)
    assert "torque_request" in tracking_note(run)


def test_an_actuation_counts_for_one_event(run: Run) -> None:
    """Two slip events in one actuation: the first has its figures, the other has none."""
    event, found = run.tracks[0].engagements[0], run.tracks[0].responses[0]
    first, second = during((event, event), (found,), "Nm")
    assert first["delay_s"] is not None
    assert set(second) == set(first)
    assert set(second.values()) == {None}


def test_a_car_without_a_torque_sensor_gets_a_band() -> None:
    """Its width is the prior of the friction; force and all else are right, so that the specimen's
    own friction makes the true torque of it; and it is said."""
    drive = simulate("alsd_car", "car", 6, duration=12.0)
    truth = drive.truth
    assert truth is not None
    own = {name: signal for name, signal in drive.items() if name != "shaft_torque"}
    run = replay(replace(drive, signals=own), "alsd_car", rate=50.0)
    estimate, time = run.tracks[0].clutch_torque, run.tracks[0].time
    assert estimate is not None
    true = np.interp(time, truth.time, truth.columns["clutch_torque"])
    passed = np.abs(true) > 200.0
    band = estimate.std[passed] / np.abs(estimate.value[passed])
    p = load_vehicle("alsd_car").parameters["friction_coefficient"]
    assert np.median(band) == pytest.approx(p.spread / p.value, rel=0.1)
    friction = truth.columns["friction"][-1]
    assert friction < 0.8  # 2.5 standard deviations below the file's: far outside the usual
    share = np.median(true[passed] / estimate.value[passed])
    assert share == pytest.approx(friction, rel=0.05)
    words = [w for w in run.summary["warnings"] if "clutch torque is not measured" in w]
    assert len(words) == 1 and "prior of the friction" in words[0]
    told = replay(drive, "alsd_car")
    assert not any("not measured" in w for w in told.summary["warnings"])
