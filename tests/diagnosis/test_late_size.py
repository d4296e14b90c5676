"""The size of a fault that begins within a drive whose log says much of it."""

from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.record.diagnosis_report import diagnosis_markdown
from clutchest.signals import Signal, Signals

STEP, PERIOD, LENGTH = 0.002, 0.02, 60.0  # s
ONSET, LOSS = 31.8, -0.25
UNITS = {"speed": "rad/s", "pressure": "bar", "drive_torque": "Nm"}


@pytest.fixture(scope="module")
def flywheel():
    return clutchest.load_vehicle(Path(__file__).parent / "flywheel.toml", trust=True)


def drive(change, seed=3):
    """Signals of a flywheel whose brake torque is × (1 + ``change(t, speed)``): a simulation of its
    own."""
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(round(LENGTH / STEP))
    stay = (t // 4).astype(int)
    wanted = rng.uniform(2.0, 20.0, stay[-1] + 1)[stay] * (t % 4 > 1.5)
    power = rng.uniform(40.0, 120.0, stay[-1] + 1)[stay]
    known = {name: np.zeros(len(t)) for name in UNITS}
    speed, pressure, torque = 60.0, 0.0, 0.0
    for k, now in enumerate(t):
        pressure += STEP * (wanted[k] - pressure) / 0.15
        torque += STEP * (np.clip(8.0 * (150.0 - speed), 0.0, power[k]) - torque) / 0.1
        for name, value in zip(UNITS, (speed, pressure, torque), strict=True):
            known[name][k] = value
        braked = 3.3 * (1.0 + change(now, speed)) * pressure * np.tanh(speed)
        speed += STEP * (torque - braked - 0.02 * speed) / 1.2
    every, noise = round(PERIOD / STEP), {"speed": 0.1, "pressure": 0.02, "drive_torque": 0.5}
    read = {
        name: value[::every] + noise[name] * rng.standard_normal(len(value[::every]))
        for name, value in known.items()
    }
    signals = {n: Signal.of(n, UNITS[n], t[::every], value) for n, value in read.items()}
    return Signals(signals, end=LENGTH)


def fault_of(change, flywheel):
    diagnosis = clutchest.diagnose(drive(change), flywheel)
    (fault,) = diagnosis.faults
    assert fault.fault == "torque_loss"
    return diagnosis, fault


def test_a_fault_put_into_the_equations_from_its_onset_on_has_its_size(flywheel):
    """To first order it was -0.106 ± 0.006."""
    _, fault = fault_of(lambda t, speed: LOSS * (t > ONSET), flywheel)
    (cause,) = fault.causes
    assert cause.determined
    assert abs(cause.size - LOSS) < 4.0 * cause.std < 0.02
    assert fault.began_s == pytest.approx(ONSET, abs=0.1)


def test_a_fault_that_does_not_act_as_its_equations_say_has_no_size(flywheel):
    """Torque whose loss comes and goes: by noise as the drive shows it, -0.237 ± 0.005 of it."""
    diagnosis, fault = fault_of(
        lambda t, speed: LOSS * (t > ONSET) * (1.0 + 0.8 * np.sin(t)), flywheel
    )
    (cause,) = fault.causes
    assert not cause.determined
    for text in (fault.what, cause.magnitude, diagnosis_markdown(diagnosis)):
        assert "size not determined" in text and "times as large as noise" in text
        assert "±" not in text.split("size not determined")[1].split("\n")[0]
    (written,) = fault.summary()["causes"]
    assert written["size"] is None and written["std"] is None
    assert "times as large as noise" in written["size_not_determined"]
