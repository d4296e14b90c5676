"""Real logs, where they are at hand: what they can tell, and what not."""

from pathlib import Path

import numpy as np
import pytest

import clutchest

DATA = Path(__file__).parents[2].parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the real logs are not on this machine")

RPM = 2 * np.pi / 60


def replayed(vehicle: str, log: str):
    v = clutchest.load_vehicle(vehicle)
    signals = clutchest.read_log(DATA / log, v)
    return signals, clutchest.replay(signals, v)


@pytest.fixture(scope="module")
def run():
    return replayed("gt350", "gt350_launch.trc")


class TestGT350:
    """A sports car's launch without any position signal."""

    def test_the_launch(self, run):
        signals, result = run
        speed, shaft = signals["engine_speed"], signals["input_shaft_speed"]

        def slip(t, half=0.15):  # averaged: the driveline shuffles at several Hz
            window = np.linspace(t - half, t + half, 61)
            a = np.interp(window, speed.time, speed.value)
            return np.mean(a - np.interp(window, shaft.time, shaft.value)) / RPM

        assert slip(1.3) == pytest.approx(1090, abs=25)
        assert slip(2.2, 0.02) == pytest.approx(1129, abs=25)
        assert all(abs(slip(t)) < 25 for t in np.arange(3.0, 8.0, 0.1))
        track = result.tracks[0]
        mode = np.array(track.mode_names)[track.mode]
        assert (mode[(track.time > 0.5) & (track.time < 2.5)] == "slipping").all()
        assert (mode[(track.time > 3.1) & (track.time < 8.0)] == "locked").all()

    def test_torque_is_the_engines_less_the_inertia_term(self, run):
        signals, result = run
        track = result.tracks[0]
        inertia = result.vehicle.parameters["engine_inertia"].value
        speed, torque = signals["engine_speed"], signals["engine_torque"]
        at = track.time[(track.time > 0.5) & (track.time < 2.0)]
        wide = 0.05
        rise = [
            np.polyfit(speed.time[near], speed.value[near], 1)[0]
            for near in (np.abs(speed.time - t) < wide + 1e-6 for t in at)
        ]
        expected = np.interp(at, torque.time, torque.value) - inertia * np.array(rise)
        found = np.interp(at, track.time, track.clutch_torque.value)
        assert np.sqrt(np.mean((found - expected) ** 2)) < 5.0

    def test_energy_and_temperature_cover_the_guesses(self, run):
        _, result = run
        launch = result.summary["engagements"][0]
        assert launch["start_s"] < 1.0
        assert 2.5 < launch["duration_s"] < 3.2
        assert launch["energy_std_J"] > 0.1 * launch["energy_J"]
        told = result.summary
        assert "heat_capacity_disc" in told["guessed_parameters"]
        assert any("guessed parameters" in warning for warning in told["warnings"])
        # a disc of half the guessed capacity lies within the stated spread
        peak = result.tracks[0].states["temp_disc"]
        row = np.argmax(peak.value)
        vehicle = result.vehicle
        half = vehicle.parameters["heat_capacity_disc"]
        assert half.spread >= 0.3 * half.value
        assert peak.std[row] > 5.0

    def test_wear_and_friction_are_not_invented(self, run):
        states = run[1].summary["states"]
        for name in ("zero_position", "friction"):
            assert states[name]["valid"] is False
            assert states[name]["why"] == "no slave position signal"
            assert states[name]["value"] is None
        assert run[1].tracks[0].states["zero_position"].valid.sum() == 0


def test_the_lock_up_of_a_j1939_truck():
    _, run = replayed("j1939_t270", "j1939_t270_drive.log")
    track = run.tracks[0]
    mode = np.array(track.mode_names)[track.mode]
    locks = track.time[np.argmax(mode == "locked")]
    assert locks == pytest.approx(1.23, abs=0.25)
    assert np.mean(mode[track.time > 1.5] == "locked") > 0.97
    assert run.summary["states"]["zero_position"]["why"] == "no slave position signal"


def test_a_truck_at_idle_without_a_gearbox_signal():
    signals, run = replayed("j1939_t270", "j1939_css_idle.mf4")
    rpm = signals["engine_speed"].value / RPM
    assert 646 < rpm.min() < rpm.max() < 655
    states = run.summary["states"]
    assert states["engine_speed"]["valid"]
    for name in set(states) - {"engine_speed"}:
        assert not states[name]["valid"]
        assert states[name]["value"] is None
    assert "input shaft speed" in states["temp_disc"]["why"]
    assert run.summary["slip_energy_J"] is None
    assert not run.summary["engagements"]
    assert set(np.array(run.tracks[0].mode_names)[run.tracks[0].mode]) == {"unknown"}
    assert any("ETC1" in warning for warning in run.summary["warnings"])
