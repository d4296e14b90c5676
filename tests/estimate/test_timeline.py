"""One event timeline from asynchronous, late, missing and invalid samples."""

from dataclasses import replace

import numpy as np
import pytest

from clutchest.errors import ClutchestError
from clutchest.estimate.samples import readings_of, slope
from clutchest.estimate.timeline import build
from clutchest.models.dry_clutch.equations import DRY_CLUTCH
from clutchest.models.regimes import Mode
from clutchest.signals import Signal, Signals, Why
from clutchest.vehicle import load_vehicle

TRUCK = load_vehicle("truck")


def drive(**changes) -> Signals:
    """Ten seconds of steady slip; signals at their own rates and phases."""

    def at(period, phase, value):
        time = np.arange(phase, 10.0, period)
        return Signal.of(
            "", "", time, value(time) if callable(value) else np.full(len(time), value)
        )

    signals = {
        "engine_speed": at(0.01, 0.000, 100.0),
        "engine_torque": at(0.01, 0.000, lambda t: 300 + 50 * t),
        "input_shaft_speed": at(0.01, 0.003, lambda t: 2.0 * t),
        "slave_position": at(0.01, 0.007, 43.0),
        "motor_position": at(0.01, 0.007, 30.0),
        "coolant_temp": at(1.0, 0.5, 85.0),
    }
    return Signals({**signals, **changes}, end=10.0)


def timeline(signals: Signals, vehicle=TRUCK, rate=10.0, **delays):
    return build(signals, vehicle, DRY_CLUTCH, rate, delays)


def column(line, name):
    return line.u[:, DRY_CLUTCH.input(name)]


def test_inputs_run_straight_between_their_own_stamps():
    line = timeline(drive())
    inside = (line.t > 0.1) & (line.t < 9.9)
    assert np.allclose(column(line, "engine_torque")[inside], 300 + 50 * line.t[inside])
    assert np.allclose(column(line, "input_shaft_speed")[inside], 2.0 * line.t[inside])
    assert (column(line, "ambient_temp") == 20.0).all()  # not mapped: its default


def test_every_kink_of_an_input_is_an_event_while_sliding():
    line = timeline(drive())
    for name in ("engine_torque", "input_shaft_speed", "slave_position"):
        assert np.isin(drive()[name].time, line.t).all()


def test_events_are_in_order_and_outputs_follow_the_last_event_of_their_time():
    line = timeline(drive())
    assert (np.diff(line.t) >= 0).all()
    rows = np.flatnonzero(line.emit >= 0)
    assert (line.emit[rows] == np.arange(len(rows))).all()
    assert all(k == len(line.t) - 1 or line.t[k + 1] > line.t[k] for k in rows)
    grid = line.t[rows][line.grid]
    assert np.allclose(grid, np.arange(len(grid)) / 10)


def test_the_order_in_which_samples_arrive_does_not_matter():
    rng = np.random.default_rng(1)
    plain, late = drive(), {}
    for name in plain:
        order = rng.permutation(len(plain[name]))
        late[name] = Signal.of(name, "", plain[name].time[order], plain[name].value[order])
    names = list(late)
    rng.shuffle(names)
    a, b = timeline(plain), timeline(Signals({n: late[n] for n in names}, end=10.0))
    for field in ("t", "sensor", "z", "R", "u", "row", "emit"):
        assert np.array_equal(getattr(a, field), getattr(b, field)), field


def test_invalid_samples_are_never_numbers():
    speed = drive()["engine_speed"]
    why = speed.why.copy()
    why[200:220] = Why.NOT_AVAILABLE
    value = speed.value.copy()
    value[200:220] = 1e6
    line = timeline(drive(engine_speed=Signal.of("", "", speed.time, value, why)))
    readings = line.z[line.sensor == DRY_CLUTCH.sensor("engine_speed")]
    assert len(readings) == len(speed) - 20
    assert (readings == 100.0).all()


def test_a_gap_is_bridged_but_carries_no_torque_information_and_is_told():
    position = drive()["slave_position"]
    keep = (position.time < 4) | (position.time > 6)
    holed = Signal.of("", "", position.time[keep], position.value[keep])
    line = timeline(drive(slave_position=holed))
    free = line.W[line.row, 0]
    assert not free[(line.t > 4.01) & (line.t < 5.99)].any()
    assert free[(line.t > 1) & (line.t < 3.9)].all()
    assert any("slave_position: 1 gap" in warning for warning in line.warnings)


def test_delays_shift_a_signal_back_to_when_it_was_true():
    late = timeline(drive(), engine_torque=0.1)
    inside = (late.t > 0.2) & (late.t < 9.8)
    assert np.allclose(column(late, "engine_torque")[inside], 300 + 50 * (late.t[inside] + 0.1))
    stated = replace(
        TRUCK,
        signals={
            **TRUCK.signals,
            "engine_torque": replace(TRUCK.signals["engine_torque"], delay=0.1),
        },
    )
    assert np.array_equal(timeline(drive(), stated).u, late.u)


@pytest.mark.parametrize("name", ["engine_speed", "engine_torque", "input_shaft_speed"])
def test_a_signal_without_any_valid_sample_is_named(name):
    plain = drive()
    dead = Signal.of(
        "", "", plain[name].time, plain[name].value, np.full(len(plain[name]), Why.ERROR, np.uint8)
    )
    with pytest.raises(ClutchestError, match=f"no valid sample of {name}"):
        timeline(drive(**{name: dead}))


def test_times_that_cannot_be_seconds_are_told():
    plain = drive()
    slow = {n: Signal.of("", "", s.time * 1000, s.value) for n, s in plain.items()}
    with pytest.raises(ClutchestError, match="are the times in seconds"):
        timeline(Signals(slow, end=10_000.0))


def test_the_zero_position_is_read_only_while_retracted():
    time = drive()["slave_position"].time
    still = Signal.of("", "", drive()["input_shaft_speed"].time, np.full(1000, 100.0))
    home = Signal.of("", "", time, np.where(time < 5, 30.0, 0.0))
    line = timeline(drive(input_shaft_speed=still, motor_position=home))
    read = line.t[line.sensor == DRY_CLUTCH.sensor("zero_position")]
    # home for 0.2 s, then the middle of the first average, twice 0.08 s long
    assert read.min() == pytest.approx(5.2 + 0.08, abs=0.02)
    assert set(line.mode[line.t < 5]) == {Mode.locked}


def test_readings_at_rest_are_averaged():
    """Averages of 17 readings, each worth one reading; what is left at the end is worth less."""
    rng = np.random.default_rng(3)
    time = np.concatenate([np.arange(0, 0.5, 0.01), np.arange(8.0, 8.17, 0.01)])
    value = rng.normal(38.0, 0.01, len(time))
    found = readings_of(Signal.of("", "", time, value), 0.01, 0.0, 0.08)
    assert found.time == pytest.approx([0.08, 0.25, 0.42, 8.08])
    assert found.value == pytest.approx(
        [value[a:b].mean() for a, b in ((0, 17), (17, 34), (34, 50), (50, 67))]
    )
    assert found.full.tolist() == [True, True, False, True]
    assert found.variance == pytest.approx(0.01**2 * np.array([1.0, 1.0, 17 / 16, 1.0]))
    assert readings_of(Signal.of("", "", time, value), 0.01, 0.95, 0.08).variance[
        0
    ] == pytest.approx(0.01**2 * 39 / 17)


def test_coloured_noise_counts_for_less():
    vehicle = replace(
        TRUCK,
        signals={
            **TRUCK.signals,
            "engine_speed": replace(TRUCK.signals["engine_speed"], noise_ar=0.5),
        },
    )
    white, coloured = timeline(drive()), timeline(drive(), vehicle)
    sensed = white.sensor == 0
    assert np.allclose(coloured.R[sensed], 3.0 * white.R[sensed])


def test_the_slope_of_a_noisy_signal_and_its_spread():
    rng = np.random.default_rng(2)
    time = np.arange(0, 200, 0.01) + rng.uniform(-0.002, 0.002, 20000)
    signal = Signal.of("", "", time, 3.0 * time + rng.normal(0, 0.06, len(time)))
    found, std = slope(signal, 0.06)
    # windows overlap: about one independent slope in eleven
    assert found.value.mean() == pytest.approx(3.0, abs=4 * std / np.sqrt(len(time) / 11))
    assert found.value.std() == pytest.approx(std, rel=0.1)
