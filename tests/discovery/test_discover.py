"""The whole way: a drive with a hidden cause in, an answer and a better model out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest.discovery import verdict
from clutchest.discovery.discover import discover
from clutchest.discovery.held_out import with_signals_of
from clutchest.discovery.result import Discovery
from clutchest.errors import ClutchestError
from clutchest.inference.problem import CLOCK, Problem
from clutchest.models import machine_of
from clutchest.models.curve_effect import curve_effects
from clutchest.models.effects import effects_of_file
from clutchest.record.discovery import write_discovery
from clutchest.vehicle import Estimation

TRUCK = clutchest.load_vehicle("truck")
HIDDEN = {"friction_speed": {"slope": -0.15}}
TRUCK_SEED = 71


def drive(seed: int, effects=None, scenario="launches", duration=600.0, **options):
    return clutchest.simulate(
        TRUCK, scenario, seed, effects, duration=duration, truck_seed=TRUCK_SEED, **options
    )


def without(signals, *lost):
    return replace(signals, signals={n: s for n, s in signals.items() if n not in lost})


@pytest.mark.parametrize("lost", ["slave_position", "input_shaft_speed"])
def test_drives_held_out_must_have_the_signals_of_the_log(lost):
    log, other = drive(71, duration=60.0), drive(72, duration=60.0)
    broken = replace(without(other, lost), sources=("tuesday.log",))
    with pytest.raises(ClutchestError, match=rf"tuesday\.log: no valid sample of {lost}, expected"):
        discover(log, TRUCK, holdout=[other, broken])


def test_of_drives_held_out_the_signals_of_the_log_count_and_every_drive():
    log, one, two = (drive(seed, duration=60.0) for seed in (71, 72, 73))
    plain = without(log, "slave_position", "coolant_temp")
    both = replace(one, later=(two,))
    for holdout in ([one, two], [both], both):
        drives = [d for each in ([holdout] if holdout is both else holdout) for d in each.drives]
        alike = with_signals_of(plain, drives, TRUCK.machine)
        assert len(alike) == 2 and all(set(d) == set(plain) for d in alike)
    assert len(with_signals_of(log, [without(one, "coolant_temp")], TRUCK.machine)) == 1
    assert with_signals_of(log, [], TRUCK.machine) == ()


def test_a_drive_held_out_must_be_another():
    """A copy of the log, whatever its name and its clock, measures nothing."""
    log = drive(71, duration=60.0)
    copy = replace(log, start_ns=7, sources=("copy.log",))
    for same in (copy, without(copy, "ambient_temp")):
        with pytest.raises(ClutchestError, match=r"copy\.log: has the readings of the log, expec"):
            discover(log, TRUCK, holdout=[drive(72, duration=60.0), same])


@pytest.fixture(scope="module")
def found() -> Discovery:
    return discover(drive(71, HIDDEN), TRUCK, holdout=drive(72, HIDDEN))


@pytest.mark.slow
def test_a_hidden_cause_is_named_with_its_size(found):
    assert found.verdict == "named"
    (cause,) = found.causes
    assert cause.effect == "friction_speed"
    slope = cause.parameters["slope"]
    assert abs(slope.value - HIDDEN["friction_speed"]["slope"]) < 3.5 * slope.std
    assert cause.p_value < 0.01
    assert found.where is not None and found.where.equation == "torque"
    assert "slip_speed" in found.where.covariates[:3]


@pytest.mark.slow
def test_a_size_beyond_what_is_plausible_is_found_as_it_is_and_said_to_be_so():
    answer = discover(drive(71, {"kiss_point": {"shift": -1.2}}), TRUCK)
    assert [cause.effect for cause in answer.causes] == ["kiss_point"]
    shift = answer.causes[0].parameters["shift"]
    assert abs(shift.value + 1.2) < 3.5 * shift.std < 0.1
    assert any("kiss_point" in w and "plausible (-1)" in w for w in answer.warnings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "signal"), [("torque_delay", "engine_torque"), ("position_delay", "slave_position")]
)
def test_a_delay_that_is_found_holds_the_tolerance_of_its_signal(effect, signal):
    """How late a signal is in all is told better than by what it may be late beyond the file; the
    slower its noise, the less well."""
    late, best = 0.035, []
    for ar in (0.0, 0.9):
        signals = {**TRUCK.signals, signal: replace(TRUCK.signals[signal], noise_ar=ar)}
        truck = replace(TRUCK, signals=signals)
        made = clutchest.simulate(truck, "slip-steps", 71, {effect: {"delay": late}})
        problem = Problem.of(made, truck, (machine_of("dry_clutch").effects[effect],))
        best.append(problem.clock(problem.index(f"{effect}.delay")))
        if ar == 0.0:
            (cause,) = discover(made, truck).causes
            assert cause.effect == effect
            delay = cause.parameters["delay"]
            assert abs(delay.value - late) < 3.5 * delay.std
            assert CLOCK <= delay.std < TRUCK.signals[signal].delay_spread
    assert best == pytest.approx([CLOCK, CLOCK * np.sqrt(19.0)])


@pytest.mark.slow
def test_what_is_found_pays_on_another_drive(found):
    assert found.gain is not None
    assert found.gain.nll_after < found.gain.nll_before
    assert found.gain.ci95[0] > 0.0
    assert found.gain.simulation_rmse_after < found.gain.simulation_rmse_before
    # a drive of the same kind says as much of the cause as the one in which it was found, as far as
    # each of them tells: a squared score of z² scatters by 2 z
    said = found.causes[0].statistic
    low, high = 2.0 * np.array(found.gain.ci95)
    assert said - 4.0 * np.sqrt(said) < high and low < said + 4.0 * np.sqrt(said)


@pytest.mark.slow
def test_what_other_drives_speak_against_is_refused_or_no_finding(monkeypatch):
    """The cause acts in one drive, and in two others of the same truck it does not."""
    one, others = drive(71, HIDDEN), (drive(72), drive(73))
    found = discover(one, TRUCK, holdout=others)
    assert found.verdict == "named"  # it is there beyond doubt
    assert found.extended.effects == TRUCK.effects
    assert any("prediction of held-out data worse" in w for w in found.warnings)
    monkeypatch.setattr(verdict, "ESTABLISHED", 0.0)  # as if it might as well be noise
    found = discover(one, TRUCK, holdout=others)
    assert (
        found.verdict == "unknown"
    )  # no cause is confirmed, and without one residuals are no noise
    assert found.causes == () and found.gain is None
    assert found.where is not None and found.where.equation.startswith("sensor:")
    assert found.extended.effects == TRUCK.effects
    assert any(
        "friction_speed" in w and "not confirmed on held-out drives" in w for w in found.warnings
    )


@pytest.mark.slow
def test_without_another_log_parts_are_foretold_by_the_rest(found):
    """On the drive itself it gains as on another of the same kind, and not everything it fits."""
    alone = discover(drive(71, HIDDEN), TRUCK).gain
    assert alone is not None and found.gain is not None
    assert (alone.other_logs, found.gain.other_logs) == (False, True)
    assert alone.ci95[0] > 0.0
    assert alone.simulation_rmse_after < alone.simulation_rmse_before
    gained = [gain.nll_before - gain.nll_after for gain in (alone, found.gain)]
    assert 0.3 < gained[0] / gained[1] < 1.2  # the null, too, has been fitted to this drive


@pytest.mark.slow
def test_the_extended_vehicle_replays_with_the_cause(found, tmp_path):
    write_discovery(found, tmp_path / "found")
    extended = clutchest.load_vehicle(tmp_path / "found" / "extended.toml")
    assert set(extended.effects) == {"friction_speed"}
    slope = found.causes[0].parameters["slope"]
    assert extended.effects_spread == {"friction_speed": {"slope": pytest.approx(slope.std)}}
    signals = drive(73, HIDDEN)
    plain, better = (clutchest.replay(signals, v) for v in (TRUCK, extended))
    assert better.tracks[0].log_likelihood > plain.tracks[0].log_likelihood


@pytest.mark.slow
def test_what_was_found_before_is_corrected_beside_what_is_found_now(tmp_path):
    """Sizes hold beside each other only."""
    earlier = replace(
        TRUCK,
        effects={"friction_speed": {"slope": -0.11}},
        effects_spread={"friction_speed": {"slope": 0.02}},
    )
    answer = discover(drive(74, HIDDEN | {"kiss_point": {"shift": 0.4}}), earlier)
    assert [c.effect for c in answer.causes] == ["kiss_point"]
    slope = answer.extended.effects["friction_speed"]["slope"]
    std = answer.extended.effects_spread["friction_speed"]["slope"]
    assert 0.0 < std < 0.01
    assert slope == pytest.approx(HIDDEN["friction_speed"]["slope"], abs=3.0 * std)
    assert set(answer.extended.effects_spread) == {"friction_speed", "kiss_point"}


@pytest.mark.slow
def test_before_fitting_it_says_what_the_log_can_tell(found):
    tells = {i.effect: i for i in found.identifiability}
    assert set(tells) == set(machine_of("dry_clutch").effects)
    assert tells["friction_speed"].excited
    assert "housing_airflow" in found.unexcited
    assert tells["heat_split"].nearest in {"expansion_disc", "heat_capacity_disc"}


@pytest.mark.slow
def test_a_clean_drive_lacks_nothing():
    answer = discover(drive(74), TRUCK)
    assert (answer.verdict, answer.causes, answer.where, answer.gain) == ("none", (), None, None)
    assert answer.extended.effects == TRUCK.effects


@pytest.mark.slow
def test_a_cause_of_the_users_own_competes_with_the_library(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from clutchest.models.effects import Effect, Number\n"
        "class Squeezed(Effect):\n"
        "    name, model, equation = 'squeezed', 'dry_clutch', 'torque'\n"
        "    parameters = (Number('change', '1', -0.5, 0.5),)\n"
        "    def terms(self, g):\n"
        "        return {'sliding_torque': lambda torque, q: torque * (1 + g.change\n"
        "                * (q.coolant_temp - 85) / 10)}\n",
        encoding="utf-8",
    )
    assert set(effects_of_file(path)) == {"squeezed"}
    answer = discover(drive(75), TRUCK, effects_files=(path,))
    assert "squeezed" in {i.effect for i in answer.identifiability}
    assert answer.verdict == "none"


class Warped:
    """Friction that rises by a step when the body is warm: no effect of the library."""

    def law(self):
        return lambda seen: {"torque_share": 0.08 * float(seen["temp_body"] > 83.0)}

    def readings(self, true):
        return true


@pytest.mark.slow
def test_a_cause_without_a_name_is_located_and_patched(tmp_path: Path):
    signals = drive(76, duration=900.0, outsider=Warped())
    truth = signals.truth
    assert truth is not None and truth.columns["temp_body"].min() < 78.0 < 88.0 < np.max(
        truth.columns["temp_body"]
    )
    # what warms a body in a drive is as slow as friction that may wander
    steady = replace(TRUCK, estimation={})
    answer = discover(signals, steady)
    assert answer.verdict == "unknown"
    assert answer.where is not None and answer.where.equation == "torque"
    rising = {"temp_body", "temp_housing", "time", "energy", "engagements"}  # as the body warms up
    assert set(answer.where.covariates[: len(rising)]) == rising
    if answer.curve is not None:
        write_discovery(answer, tmp_path / "found")
        extended = clutchest.load_vehicle(tmp_path / "found" / "extended.toml")
        better = clutchest.replay(signals, extended)
        assert not any("without curve" in w for w in better.summary["warnings"])


class Squeezed:
    """A film that must be squeezed out, Nm s/mm."""

    def law(self):
        return lambda seen: {"torque": 5.0 * seen["position_rate"]}

    def readings(self, true):
        return true


@pytest.mark.slow
def test_what_wanders_beside_an_error_is_not_taken_for_it():
    walks = {"friction": 5e-4, "torque_bias": 0.5}
    states = {s.name: s for s in TRUCK.machine.states}
    stated = {
        name: Estimation(s.role, s.process_noise, s.initial_std, s.useful_std, walks[name])
        for name, s in states.items()
        if name in walks
    }
    disturbances = {f"{name}_walk": density for name, density in walks.items()}
    signals, other = (
        drive(seed, outsider=Squeezed(), disturbances=disturbances) for seed in (76, 77)
    )
    answer = discover(signals, replace(TRUCK, estimation=stated), holdout=[other])
    assert answer.verdict == "unknown" and answer.where is not None
    assert answer.where.equation == "torque" and answer.where.covariates[0] == "position_rate"


class Floating:
    """An open clutch lets the disc float: it gives less heat to the body, W/K."""

    def law(self):
        def act(seen):
            kept = 90.0 * (seen["temp_disc"] - seen["temp_body"]) * (seen["motor_position"] > 8.0)
            return {"disc_heat": kept, "body_heat": -kept}

        return act

    def readings(self, true):
        return true


@pytest.mark.slow
def test_contact_that_an_open_clutch_loses_is_heat_exchanged_by_position():
    signals, other = (drive(seed, scenario="city", outsider=Floating()) for seed in (78, 79))
    answer = discover(signals, TRUCK, holdout=[other])
    assert answer.verdict == "unknown" and answer.where is not None
    assert answer.where.equation == "disc_heat" and answer.where.covariates[0] == "slave_position"


class Lazy:
    """The torque report is the later the slower the engine turns."""

    def law(self):
        return None

    def readings(self, true):
        def torque(t):
            return true["engine_torque"](
                t - 0.05 * np.clip((130.0 - true["engine_speed"](t)) / 65, 0, 1)
            )

        return {**true, "engine_torque": torque}


@pytest.fixture(scope="module")
def clock(tmp_path_factory: pytest.TempPathFactory):
    """What is found of a clock in one drive, another held out; where it is written; the other."""
    one, other = (drive(seed, duration=900.0, outsider=Lazy()) for seed in (76, 77))
    answer, found = discover(one, TRUCK, holdout=other), tmp_path_factory.mktemp("found")
    write_discovery(answer, found)
    return answer, found, other


@pytest.mark.slow
def test_a_clock_that_is_near_a_name_is_patched_and_pays(clock):
    """The report is late, but not by a constant."""
    answer, found, _ = clock
    assert answer.verdict == "named" and [c.effect for c in answer.causes] == ["torque_delay"]
    form = answer.causes[0].form
    assert form.refuted and form.curve is not None and form.curve.covariate == "engine_speed"
    assert answer.where is not None and answer.where.equation == "timing:engine_torque"
    assert answer.where.covariates[0] == "engine_speed"
    assert answer.gain is not None and answer.gain.ci95[0] > 0.0
    extended = clutchest.load_vehicle(found / "extended.toml")
    curve = extended.curves["curve_1"]
    late = curve_effects("curve_1", curve, TRUCK.machine)[0].lateness["engine_torque"]
    seconds = extended.effects["torque_delay"]["delay"] + np.interp(75.0, late.at, late.seconds)
    assert seconds == pytest.approx(0.042, abs=0.01)


@pytest.mark.slow
def test_a_patched_clock_leaves_nothing_over(clock):
    _, found, other = clock
    extended = clutchest.load_vehicle(found / "extended.toml")
    assert discover(other, extended).verdict == "none"


@pytest.mark.slow
def test_beside_a_patched_clock_another_cause_is_found(clock):
    """What the patch may be off by does not swallow it."""
    _, found, _ = clock
    extended = clutchest.load_vehicle(found / "extended.toml")
    answer = discover(drive(90, HIDDEN, duration=900.0, outsider=Lazy()), extended)
    assert answer.verdict == "named" and [c.effect for c in answer.causes] == ["friction_speed"]
    slope = answer.causes[0].parameters["slope"]
    assert abs(slope.value - HIDDEN["friction_speed"]["slope"]) < 3.0 * slope.std < 0.03


def test_a_delay_that_varies_is_nothing_to_look_for(tmp_path: Path):
    (tmp_path / "own.py").write_text(
        "from clutchest.models.effects import Effect, Lateness, Number\n"
        "class Own(Effect):\n"
        "    name, model, equation = 'own', 'dry_clutch', 'timing:engine_torque'\n"
        "    parameters = (Number('size', '1', 0.0, 2.0),)\n"
        "    delays = {'engine_torque': 'size'}\n"
        "    lateness = {'engine_torque': Lateness('time', (0.0, 9.0), (0.0, 0.1))}\n"
    )
    with pytest.raises(ClutchestError, match="'own' has a delay that varies"):
        discover(drive(71), TRUCK, effects_files=(tmp_path / "own.py",))
