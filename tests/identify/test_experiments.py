"""Experiments on benches: what they determine, what they say they cannot, and how a bench is
known."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import chi2

import clutchest
from clutchest.cli import app
from clutchest.errors import ClutchestError
from clutchest.generator.alsd.generate import draw
from clutchest.identify import identify_vehicle, procedures
from clutchest.identify.bench_records import bench_records, stated_sections
from clutchest.identify.equation_errors import fit_errors
from clutchest.identify.fit import Fit, fit_rows
from clutchest.models import machine_of
from clutchest.models.experiments import NO_OWN, BenchSection, EquationErrors
from clutchest.reading import read_log
from clutchest.shown import plus_minus
from clutchest.vehicle import load_vehicle

SEED = 41
RIG = load_vehicle("alsd_rig")
TRUTH = draw(
    {key: p.value for key, p in RIG.parameters.items()},
    {key: p.spread for key, p in RIG.parameters.items()},
    SEED,
)
QUICK = {
    name: replace(RIG.signals[name], period=1e-4)
    for name in ("armature_voltage", "armature_current")
}
AT_10_KHZ = replace(RIG, signals={**RIG.signals, **QUICK})


def log(name: str, seed: int = SEED, vehicle=RIG, duration: float | None = None):
    return clutchest.simulate(vehicle, name, seed, truck_seed=SEED, duration=duration)


def run(name: str, signals, vehicle=RIG, holdout=None, benches=((), ())) -> Fit:
    return identify_vehicle(name, signals, vehicle, lambda text, share: None, holdout, benches)


def holds(fit: Fit, *keys: str) -> None:
    """Every one of ``keys`` is determined, right within four standard deviations."""
    for key in keys:
        found = fit.parameters[key]
        assert found.determined, key
        assert abs(found.value - TRUTH[key]) < 4 * found.std, key
        assert found.std < 0.8 * RIG.parameters[key].spread


@pytest.mark.parametrize(
    ("name", "duration", "keys"),
    [
        ("I1", 60.0, ("armature_resistance", "resistance_temp_coefficient")),
        ("I3", 18.0, ("back_emf_constant",)),
        ("I4", 60.0, ("torque_constant", "torque_constant_temp_coefficient")),
        (
            "I5",
            None,
            ("motor_inertia", "motor_coulomb_torque", "motor_viscous", "motor_static_torque"),
        ),
        ("I6", None, ("ball_ramp_friction", "spring_preload")),
        ("I7", None, ("ball_ramp_stiffness", "pack_stiffness", "free_play", "gear_backlash")),
        ("I8", None, ("torsional_stiffness", "differential_backlash", "driveline_friction")),
    ],
)
def test_what_an_experiment_determines_is_right(name, duration, keys, tmp_path):
    fit = run(name, log(name, duration=duration))
    holds(fit, *keys)
    assert any("bench guessed from the data" in note for note in fit.notes)
    assert any(note.startswith(f"{name}: ") for note in fit.notes)
    fit.draw(tmp_path)
    pictures = {"I5": 2, "I7": 2}  # torque over speed and break-away; both benches
    assert len(list(tmp_path.glob("*.png"))) == pictures.get(name, 1)


@pytest.mark.parametrize("name", ["I1", "I3", "I4", "I5", "I6", "I7", "I8"])
def test_equation_errors_of_the_truth_are_noise(name):
    """The generator solves the equations otherwise; what is left is its sensors' noise."""
    lasts = 60.0 if name in ("I1", "I4") else None
    records = bench_records(log(name, SEED + 7, duration=lasts), RIG)
    true = {
        key: replace(p, value=TRUTH.get(key, p.value), spread=1e-9)
        for key, p in RIG.parameters.items()
    }
    specimen = replace(RIG, parameters=true)
    (experiment,) = (e for e in machine_of("alsd").experiments if e.name == name)
    parts = [experiment.reduce(record) for record in records.on(experiment.benches)]
    for part, scale in zip(parts, fit_errors(parts, specimen).scale, strict=True):
        count = len(part.errors(TRUTH, part.own[:, 0]))
        assert count > 10
        assert scale < 1.1 * np.sqrt(chi2.isf(1e-4, count) / count)


def test_an_inductance_takes_a_fast_log():
    with pytest.raises(ClutchestError, match=r"nothing could be determined; I2: .* 5 ms apart"):
        run("I2", log("I2"))
    both = replace(log("I1", duration=20.0), later=(log("I2"), log("I2", SEED + 1)))
    assert run("all", both).parameters["armature_inductance"].why.count("5 ms apart") == 1
    known = replace(RIG.parameters["armature_resistance"], spread=2e-4)
    known = replace(known, value=TRUTH["armature_resistance"])
    car = replace(RIG, parameters={**RIG.parameters, "armature_resistance": known})
    fit = run("I2", log("I2", vehicle=AT_10_KHZ, duration=3.0), car)
    holds(fit, "armature_inductance")
    assert fit.parameters["armature_inductance"].std < 0.02 * TRUTH["armature_inductance"]


def test_all_puts_benches_together_and_is_surer():
    held, alone = log("I1", duration=60.0), log("I3", SEED + 1, duration=18.0)
    both = run("all", replace(held, later=(alone,)))
    holds(both, "armature_resistance", "back_emf_constant", "torque_constant")
    one = run("I3", alone)
    key = "back_emf_constant"
    assert both.parameters[key].std < one.parameters[key].std


def test_a_log_of_another_bench_is_refused():
    with pytest.raises(ClutchestError, match="I3 needs a log from bench motor-alone; these are"):
        run("I3", log("I1", duration=20.0))
    stated = ((BenchSection(0.0, 1e3, "car"),),)
    with pytest.raises(ClutchestError, match=r"I1 needs a log from bench rotor-held; these .* car"):
        run("I1", log("I1", duration=20.0), benches=(stated, ()))


def test_a_bench_that_the_data_contradict_is_refused():
    """A motor alone that is said to be held: its back EMF would be resistance."""
    stated = ((BenchSection(0.0, 1e3, "rotor-held"),),)
    said = r"I1: .* miss by \d+ times the noise; .* rotor-held, but looks like motor-alone$"
    with pytest.raises(ClutchestError, match=said):
        run("I1", log("I3", duration=10.0), benches=(stated, ()))


def test_a_record_of_two_benches_stated_to_be_one_is_named():
    """The second half of I7 has its output fixed; taken for the whole rig, the fit misses."""
    stated = ((BenchSection(-np.inf, np.inf, "rig"),),)
    fit = run("I7", log("I7"), benches=(stated, ()))
    (far,) = (w for w in fit.warnings if "times the noise" in w)
    assert far.endswith("is stated to be of bench rig, but looks like rig, output-fixed")


def test_logs_of_one_name_keep_their_benches(tmp_path):
    """Two folders, a log of the same name in each; by name alone, both had the last one's bench."""
    logs = []
    for name, seconds in (("I1", 20.0), ("I3", 18.0)):
        (tmp_path / name).mkdir()
        logs.append(str(tmp_path / name / "run.v1.csv"))
        log(name, duration=seconds).save(logs[-1])
    benches = ["rotor-held", "motor-alone"]
    named = stated_sections(read_log(logs, RIG), logs, benches, RIG)
    assert [section.bench for (section,) in named] == benches
    fit = clutchest.identify("all", logs, RIG, benches=benches)
    for key in ("armature_resistance", "torque_constant", "back_emf_constant"):
        assert fit.parameters[key].determined
    with pytest.raises(ClutchestError, match="2 benches for 1 log, expected one"):
        stated_sections(read_log(logs[0], RIG), logs[:1], benches, RIG)


def test_benches_by_name():
    held = log("I1", duration=20.0)
    known = clutchest.identify("I1", held, RIG)
    for benches in ("rotor-held", ["rotor-held"]):
        again = clutchest.identify("I1", held, RIG, progress=None, benches=benches)
        assert again.parameters == known.parameters
    for benches, said in (
        (
            "rotor_held",
            "bench: machine 'alsd' has no bench 'rotor_held'; did you mean 'rotor-held'",
        ),
        (["rotor-held"] * 3, "benches: 3 for 1 drive, expected one, or one for each"),
        ((("rotor-held",), ()), "benches: expected a BenchSection, not 'r'"),
        (3, "benches: expected a text or a list, not 3"),
    ):
        with pytest.raises(ClutchestError, match=said):
            clutchest.identify("I1", held, RIG, benches=benches)


def test_a_log_that_holds_nothing_of_an_experiment_is_refused_once():
    """A held rotor that is said to be a motor alone: no run, so none of the six numbers."""
    stated = ((BenchSection(0.0, 1e3, "motor-alone"),),)
    with pytest.raises(ClutchestError, match="nothing could be determined; I5: no run") as refused:
        run("I5", log("I1", duration=20.0), benches=(stated, ()))
    assert str(refused.value).count("no run") == 1


def test_runs_that_a_stated_noise_excludes_are_counted():
    """A current noisier than the vehicle file says leaves no run, and who reads it should know."""

    def stating(noise: float):
        mapped = replace(RIG.signals["armature_current"], noise=noise)
        return replace(RIG, signals={**RIG.signals, "armature_current": mapped})

    said = r"\d+ of \d+ stretches between steps .* its noise of 0\.022 A make; `identify noise`"
    fit = run("I5", log("I5"), stating(0.022))
    assert any(re.search(said, note) for note in fit.notes)
    with pytest.raises(
        ClutchestError, match=r"no slow break-away; \d+ of \d+ stretches .* 0\.01 A"
    ):
        run("I5", log("I5"), stating(0.01))


def test_numbers_far_from_what_is_stated_are_named():
    """An angle in revolutions is an even motor with six times the voltage constant, to a vehicle
    whose spreads are a third; a wrong sign is none at all."""
    wide = replace(RIG.parameters["back_emf_constant"], spread=0.3 * 0.04)
    car = replace(RIG, parameters={**RIG.parameters, "back_emf_constant": wide})
    alone = log("I3", duration=18.0)

    def by(factor: float) -> Fit:
        angle = alone["motor_angle"]
        turned = replace(angle, value=factor * angle.value)
        return run("I3", replace(alone, signals={**alone.signals, "motor_angle": turned}), car)

    assert not any("back_emf_constant =" in warning for warning in by(1.0).warnings)
    (far,) = (w for w in by(0.5 / np.pi).warnings if "back_emf_constant =" in w)
    assert "18 standard deviations from the vehicle file's 0.04 ± 0.012 V s" in far
    assert "a wrong unit" in far
    assert any("look for a wrong sign" in warning for warning in by(-1.0).warnings)


def test_a_log_without_its_signal_is_refused():
    signals = log("I4", duration=10.0)
    without = {name: s for name, s in signals.items() if name != "motor_torque"}
    with pytest.raises(ClutchestError, match="I4: the log has no motor_torque"):
        run("I4", replace(signals, signals=without))


@pytest.mark.slow
def test_benches_are_guessed_from_the_data():
    expected = {
        "I1": ["rotor-held"],
        "I2": ["rotor-held"],
        "I3": ["motor-alone"],
        "I4": ["rotor-held"],
        "I5": ["motor-alone"],
        "I6": ["no-pack"],
        "I7": ["rig", "output-fixed"],
        "I8": ["rig"],
        "rig-steps": ["rig"],
        "rig-ramps": ["rig"],
    }
    for name, benches in expected.items():
        signals = log(name, duration=20.0 if name in ("I1", "I4", "rig-steps") else None)
        assert [r.bench for r in bench_records(signals, RIG).records] == benches, name
    car = clutchest.simulate("alsd_car", "car", SEED, duration=10.0)
    records = bench_records(car, load_vehicle("alsd_car")).records
    assert [r.bench for r in records] == ["car"]


def test_found_numbers_pay_on_another_log():
    fit = run("I1", log("I1", duration=60.0), holdout=log("I1", SEED + 1, duration=60.0))
    assert fit.validation is not None and fit.validation.gained > 10.0
    error = fit.validation.error("I1")
    assert error.after < 1.5 < 3.0 < error.before
    with pytest.raises(ClutchestError, match="the log held out: I1 needs a log from bench rotor"):
        run("I1", log("I1", duration=20.0), holdout=log("I3", duration=10.0))


def test_each_bench_of_an_experiment_is_validated():
    fit = run("I7", log("I7"), holdout=log("I7", SEED + 1))
    assert [e.name for e in fit.validation.errors] == ["I7_rig", "I7_output-fixed"]
    assert all(e.after < 1.5 < e.before for e in fit.validation.errors)
    assert fit.validation.as_dict()["I7_rig_before"] == fit.validation.errors[0].before


def test_a_loop_is_drawn_whole(tmp_path):
    """What the estimator leaves out too, as where the motor passes the free play faster and
    faster."""
    (record,) = (r for r in bench_records(log("I7"), RIG).records if r.bench == "rig")
    (experiment,) = (e for e in machine_of("alsd").experiments if e.name == "I7")
    part = experiment.reduce(record)
    used, left = (
        of(TRUTH, part.own[:, 0]) for of in (part.curves[0].points, part.curves[0].left_out)
    )
    run_up = (left[0] > 8.0) & (left[0] < 18.0) & (left[1] > 0.08)
    assert run_up.sum() > 5 and not (used[1][used[0] < 18.0] > 0.08).any()


def test_what_was_measured_is_said_by_the_fitted_numbers():
    """The loop less the motor's friction: by the file's friction its width is another."""
    fit = run("all", replace(log("I5"), later=(log("I6"),)))
    (said,) = (note for note in fit.notes if note.startswith("I6: less"))
    found = fit.parameters["ball_ramp_friction"]
    assert abs(float(said.rpartition(" = ")[2]) - found.value) < 3 * found.std


def test_a_fit_of_what_is_linear_is_the_weighted_mean():
    """Two readings of one parameter, with its prior, and a number of the record's own."""
    key = "armature_resistance"
    prior = RIG.parameters[key]
    z, std = np.array([0.40, 0.41]), 0.01

    def errors(p, own):
        return np.append((z - p[key]) / std, (3.0 - own[0]) / 0.1)

    part = EquationErrors(errors, np.array([[2.0, 0.1]]))
    posterior = fit_errors([part], RIG, widened=False)
    weights = np.array([1 / std**2, 1 / std**2, 1 / prior.spread**2])
    assert posterior.keys == (key,)
    expected = np.append(z, prior.value) @ weights / weights.sum()
    assert posterior.of(key) == pytest.approx((expected, weights.sum() ** -0.5))
    assert posterior.own[0] == pytest.approx([2.5])
    worse = fit_errors([EquationErrors(lambda p, own: 10 * errors(p, [3.0]), NO_OWN)], RIG)
    assert worse.scale[0] > 3.0  # errors beyond their noise widen what is found


def test_all_of_a_machine_with_experiments():
    names = list(procedures(machine_of("alsd")))
    assert names[0] == "noise" and names[-1] == "all" and "I1" in names


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"parameters": ("armature_resistanc",)}, "no parameter 'armature_resistanc'; did you"),
        ({"benches": ("rotor",)}, "has no bench 'rotor'"),
        ({"signals": ("current",)}, "has no column 'current'"),
    ],
)
def test_an_experiment_of_what_is_not_there_is_refused(change, words):
    machine = machine_of("alsd")
    wrong = replace(machine.experiments[0], **change)
    with pytest.raises(ClutchestError, match="experiment 'I1'") as error:
        replace(machine, experiments=(wrong,))
    assert words in str(error.value)


def command(*arguments: str):
    return CliRunner().invoke(app, ["identify", *map(str, arguments), "--vehicle", "alsd_rig"])


@pytest.mark.slow
def test_the_command_takes_the_bench_from_option_metadata_or_data(tmp_path):
    held, alone = tmp_path / "held.log", tmp_path / "alone.csv"
    for path, name, duration in ((held, "I1", 30.0), (alone, "I3", 10.0)):
        clutchest.simulated.write_simulation(
            path, RIG, name, SEED, truck_seed=SEED, duration=duration
        )
    out = tmp_path / "out"
    result = command("all", held, alone, "--out", out)
    assert result.exit_code == 0, result.output
    told = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    assert not any("guessed" in note for note in told["notes"])
    found = load_vehicle(out / "vehicle.toml")
    for key, fitted in told["parameters"].items():
        assert found.parameters[key].value == fitted["value"]
        assert found.parameters[key].spread == fitted["std"]
    source = found.parameters["back_emf_constant"].source
    assert source.startswith("clutchest identify all, ") and "alone.csv" in source
    assert {p.name for p in out.glob("*.png")} >= {"resistance.png", "voltage_constant.png"}

    wrong = command("I1", held, "--bench", "rotor-hold", "--out", out)
    assert wrong.exit_code == 1 and "no bench 'rotor-hold'; did you mean" in str(wrong.exception)
    many = command("I1", held, "--bench", "rig", "--bench", "car", "--out", out)
    assert many.exit_code != 0
    other = command("I1", held, "--bench", "car", "--out", out)
    assert other.exit_code == 1 and "these are from car" in str(other.exception)


# --- beside it: the likelihood of all readings ---


@pytest.mark.slow
def test_the_likelihood_of_the_record_beside_the_experiments():
    """Every number of I7 by both ways: right, and not the same number twice."""
    fit = identify_vehicle("I7", log("I7"), RIG, refit=True)
    for key in ("ball_ramp_stiffness", "pack_stiffness", "free_play", "gear_backlash"):
        found = fit.parameters[key]
        assert abs(found.refit.value - TRUTH[key]) < 4 * found.refit.std, key
        assert found.refit.std < RIG.parameters[key].spread
        assert found.refit.value != found.value
    assert fit.parameters["free_play"].refit.bench == "rig"
    (row,) = (row for row in fit_rows(fit, RIG) if row.name == "free_play")
    again = fit.parameters["free_play"].refit
    assert row.remark.endswith(f"record from rig: {plus_minus(again.value, again.std)}")
    assert "likelihood of the record from" in json.dumps([row.remark for row in fit_rows(fit, RIG)])


def test_no_refit_unless_asked_for_and_none_of_another_procedure():
    quiet = run("I3", log("I3", duration=18.0))
    assert all(fitted.refit is None for fitted in quiet.parameters.values())
    truck = load_vehicle("truck")
    with pytest.raises(ClutchestError, match="fitted by the likelihood already"):
        identify_vehicle("disc", clutchest.read_log("demo", truck), truck, refit=True)


@pytest.mark.parametrize("bench", machine_of("alsd").benches.names)
def test_the_equations_on_a_bench_leave_out_what_is_not_there(bench):
    on_bench = machine_of("alsd").on_bench(bench)
    assert on_bench is machine_of("alsd").on_bench(bench), "declared once, not for each fit"
    model = on_bench.to_fit(RIG.signals)
    written = model.expressions()
    rate = written.rate[model.state("motor_speed")]
    assert ca.depends_on(rate, written.x) == (bench != "rotor-held")
    loaded = ca.depends_on(rate, written.x[model.state("plate_position")])
    assert loaded == (bench not in ("rotor-held", "motor-alone"))
    plate = written.rate[model.state("plate_position")]
    pressed = [q.key for q in model.parameters].index("pack_stiffness")
    assert ca.depends_on(plate, written.p[pressed]) == (bench not in ("no-pack", "output-fixed"))


def test_a_bench_without_equations_is_refused():
    with pytest.raises(ClutchestError, match=r"no equations on bench 'rigs'.*rig"):
        machine_of("alsd").on_bench("rigs")
    with pytest.raises(ClutchestError, match="declares no equations on bench"):
        machine_of("dry_clutch").on_bench("rig")
