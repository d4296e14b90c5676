"""Judder: lines put into the torque of simulated runs, and runs without one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import gammaln
from scipy.stats import gamma

from clutchest.estimate.judder import _leading_term, _log_sf
from clutchest.estimate.replay import replay
from clutchest.estimate.run import Run
from clutchest.models import machine_of
from clutchest.models.alsd.judder import DAMPING
from clutchest.record.tracking import judder_words
from clutchest.signals import Floats, Signals
from clutchest.simulated import simulate
from clutchest.vehicle import load_vehicle

JUDDER = machine_of("alsd").judder
TOUCHING = 100.0  # Nm


def swinging(signals: Signals, phase: Floats, amplitude: float) -> Signals:
    """With a sine of ``phase`` (k,), in turns, in the torque while surfaces are pressed."""
    torque = signals["clutch_torque"]
    wave = amplitude * np.sin(2 * np.pi * phase) * (np.abs(torque.value) > TOUCHING)
    changed = replace(torque, value=torque.value + wave)
    return replace(signals, signals={**signals.signals, "clutch_torque": changed})


@pytest.fixture(scope="module")
def steps() -> Signals:
    return simulate("alsd_rig", "rig-steps", 51, duration=12.0)


@pytest.fixture(scope="module")
def sweep() -> Signals:
    return simulate("alsd_rig", "slip-oil-sweep", 52, duration=30.0)


def found(run: Run):
    (track,) = run.tracks
    return track.judder


def test_a_resonance(steps: Signals) -> None:
    time = steps["clutch_torque"].time
    run = replay(swinging(steps, 12.6 * time, 15.0), "alsd_rig")
    line = found(run)
    assert line.frequency_hz == pytest.approx(12.6, abs=0.2)
    assert line.amplitude == pytest.approx(15.0, rel=0.15)
    assert line.kind == "either", "one slip parts no order from a frequency"
    assert line.order == pytest.approx(12.6 * 2 * np.pi / line.slip, rel=0.02)
    (entry,) = run.summary["judder"]
    assert entry["amplitude_Nm"] == line.amplitude and entry["drive"] == 0
    (words,) = judder_words(run)
    assert "Hz" in words and "s/m" in words


def test_the_friction_slope_undoes_the_damping(steps: Signals) -> None:
    """One per cent of damping of the mode c = 2 ζ k/ω against dT/dω of the friction at that slope:
    T = μ N r F and v = r ω."""
    p = {key: q.value for key, q in load_vehicle("alsd_rig").parameters.items()}
    slope = JUDDER.slope(p, {"slip_speed"}, 10.0, 1200.0)
    surfaces = p["friction_surfaces"] * p["equivalent_radius"]
    force = 1200.0 / (p["friction_coefficient"] * surfaces)
    by_friction = slope * p["equivalent_radius"] * surfaces * force
    omega = 2 * np.pi * 10.0
    inertia = p["torsional_stiffness"] / omega**2
    assert by_friction == pytest.approx(2 * DAMPING * omega * inertia, rel=1e-9)
    softer = JUDDER.slope(p, {"wheel_speed_left"}, 10.0, 1200.0)
    assert softer < slope, "half-shafts in series make the structure softer"


@pytest.mark.parametrize("order", [12.0, 24.0])
def test_something_that_turns_with_the_slip(sweep: Signals, order: float) -> None:
    """Also where the slip dwells, so that most windows hold one frequency."""
    torque, slip = sweep["clutch_torque"], sweep["slip_speed"]
    speed = np.abs(slip.at(torque.time))
    turned = np.concatenate([[0.0], np.cumsum(np.diff(torque.time) * (speed[1:] + speed[:-1]) / 2)])
    line = found(replay(swinging(sweep, order * turned / (2 * np.pi), 10.0), "alsd_rig"))
    assert line.kind == "order" and line.friction_slope is None
    assert line.order == pytest.approx(order, rel=0.03)


def test_the_same_log_with_a_resonance(sweep: Signals) -> None:
    time = sweep["clutch_torque"].time
    line = found(replay(swinging(sweep, 14.3 * time, 15.0), "alsd_rig"))
    assert line.kind == "frequency" and line.order is None
    assert line.frequency_hz == pytest.approx(14.3, abs=0.2)


def test_a_healthy_run_has_none(steps: Signals, sweep: Signals) -> None:
    for signals in (steps, sweep):
        run = replay(signals, "alsd_rig")
        assert found(run) is None and run.summary["judder"] == []
        assert judder_words(run) == []


def test_none_without_a_torque_sensor_and_of_other_machines(steps: Signals) -> None:
    signals = {n: s for n, s in steps.signals.items() if n != "clutch_torque"}
    assert found(replay(replace(steps, signals=signals), "alsd_rig")) is None
    assert machine_of("dry_clutch").judder is None


def test_how_seldom_a_line_is_beyond_floating_point_numbers_too() -> None:
    shape = np.array([3.0, 40.0, 400.0, 40.0])
    x = np.array([20.0, 60.0, 300.0, 5000.0])
    exact, far = _log_sf(x, shape)[:3], _log_sf(x, shape)[3]
    np.testing.assert_allclose(exact, gamma.logsf(x[:3], shape[:3]), rtol=1e-12, atol=1e-15)
    assert not np.isfinite(gamma.logsf(x[3], shape[3])) and far < -4000.0


def test_the_quick_bound_is_below_how_seldom_a_line_is() -> None:
    shape, x = (a.ravel() for a in np.meshgrid(np.geomspace(1.0, 1e4, 60), np.geomspace(1.0, 30.0)))
    x = shape * x
    share = _log_sf(x, shape)
    bound = _leading_term(x, shape, gammaln(shape))
    assert np.all(bound <= share + 1e-9 * np.abs(share))
    at_mean = _log_sf(shape, shape)
    assert np.all(at_mean >= -1.0)


def test_a_healthy_run_is_judged_by_the_bound_alone(
    steps: Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless a line may be there, ``scipy.special`` is not loaded."""
    asked = []
    monkeypatch.setattr("clutchest.estimate.judder._log_sf", lambda *given: asked.append(given))
    assert found(replay(steps, "alsd_rig")) is None
    assert not asked
