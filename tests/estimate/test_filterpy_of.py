"""The model in filterpy's hands: what the docs show runs, and equals the replay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

import clutchest
from clutchest.errors import ClutchestError
from clutchest.estimate import whole_log
from clutchest.estimate.initial_state import fresh
from clutchest.estimate.whole_log import CONSIDERING

PAGE = Path(__file__).parents[2] / "docs" / "filterpy.md"


@pytest.mark.slow
def test_what_the_docs_show_is_the_replay(capsys: pytest.CaptureFixture[str]) -> None:
    code = PAGE.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    names: dict[str, object] = {}
    exec(code, names)
    ekf, vehicle = names["ekf"], names["vehicle"]
    assert isinstance(ekf, ExtendedKalmanFilter)
    assert len(capsys.readouterr().out.splitlines()) == len(ekf.x) == len(ekf.names)
    line = ekf.timeline
    line = replace(
        line,
        **{name: getattr(line, name)[:3000] for name in ("t", "sensor", "z", "R", "u", "row")},
        emit=np.arange(3000),
        grid=np.ones(3000, bool),
    )
    ours = whole_log.run(ekf.compiled, line, fresh(vehicle, ekf.compiled, line), CONSIDERING)
    n, std = len(ours.final.x), np.sqrt(np.diag(ekf.P))
    assert np.all(np.abs(ours.final.x - ekf.x[:n]) <= 1e-9 * np.maximum(np.abs(ekf.x[:n]), std[:n]))
    assert np.all(np.abs(np.sqrt(ours.total[-1]) - std[:n]) <= 1e-9 * std[:n])
    theirs = ekf.belief()
    own = np.sqrt(np.diag(theirs.P))
    assert np.all(np.abs(ours.final.P - theirs.P) <= 1e-9 * np.outer(own, own))
    assert np.max(np.abs(ours.final.S - theirs.S) * ekf.compiled.spread / std[:n, None]) <= 1e-9


@pytest.mark.slow
def test_a_replay_with_either_engine_is_the_same() -> None:
    vehicle = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(vehicle, "launches", 3, duration=25.0)
    ours = clutchest.replay(signals, vehicle)
    theirs = clutchest.replay(signals, vehicle, engine="filterpy")
    a, b = ours.tracks[0], theirs.tracks[0]
    estimates = [(state, b.states[name]) for name, state in a.states.items()]
    for x, y in (*estimates, (a.clutch_torque, b.clutch_torque), (a.slip_energy, b.slip_energy)):
        larger = np.maximum(np.abs(x.value), x.std)
        assert np.all(np.abs(x.value - y.value) <= 1e-9 * larger)
        assert np.all(np.abs(x.std - y.std) <= 1e-9 * np.maximum(x.std, 1e-9 * larger))
        assert np.array_equal(x.valid, y.valid)
    np.testing.assert_allclose(a.innovations.innovation, b.innovations.innovation, atol=1e-9)
    assert b.log_likelihood == pytest.approx(a.log_likelihood, rel=1e-9)
    assert len(a.engagements) == len(b.engagements) == 1
    for key in ("P", "signature", "slip_energy_covariance"):
        mine = np.array(ours.final[key])
        np.testing.assert_allclose(theirs.final[key], mine, rtol=1e-6, atol=1e-9 * mine.max())


def test_without_signals_it_takes_what_one_gives() -> None:
    ekf = clutchest.filterpy_of("truck", consider=False)
    start, doubt = ekf.x.copy(), np.sqrt(np.diag(ekf.P))
    sensor, u = ekf.names.index("engine_speed"), ekf.timeline.u[0]
    ekf.advance(0.1, u, u, 0)
    read = ekf.compiled.model.sensor("engine_speed")
    ekf.correct(read, start[sensor] + 1.0, 0.01, u, 0)
    assert start[sensor] < ekf.x[sensor] <= start[sensor] + 1.0
    assert np.sqrt(ekf.P[sensor, sensor]) < min(0.11, doubt[sensor])
    assert np.isfinite(ekf.log_likelihood) and ekf.K.shape == (len(ekf.x), 1)


def test_an_engine_that_is_none() -> None:
    vehicle = clutchest.load_vehicle("truck")
    signals = clutchest.read_log("demo", vehicle)
    with pytest.raises(ClutchestError, match=r"unknown engine 'filterpi'.*filterpy"):
        clutchest.replay(signals, vehicle, engine="filterpi")
