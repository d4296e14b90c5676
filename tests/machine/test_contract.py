"""Whatever is wrong with a machine is one line that names the piece."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest

from clutchest import models
from clutchest.errors import ClutchestError
from clutchest.models import machine_in_file, machine_of
from clutchest.models.equation_slips import one_slip
from clutchest.models.machine import Machine
from clutchest.models.machine_defects import defects
from clutchest.vehicle import load_vehicle

SERVO = Path(__file__).parents[2] / "machines" / "servo"
TEXT = (SERVO / "servo.py").read_text(encoding="utf-8")

DEFECTS = {  # what is replaced, by what, and words of the message
    "state twice": ('State("speed"', 'State("current"', "states names 'current' twice"),
    "unit of a state": ('"speed", "rad/s"', '"speed", "rad/fortnight"', "states has speed in"),
    "unit of a parameter": ('"viscous", "Nm s/rad"', '"viscous", "Nmx"', "parameters has viscous"),
    "parameter that is not declared": (
        "q.viscous * q.speed",
        "q.viscosity * q.speed",
        "equations use 'viscosity' in line 25, which is neither declared nor assigned before; "
        "did you mean 'viscous'",
    ),
    "quantity that is assigned otherwise": (
        "(q.motor_torque - q.friction)",
        "(q.moter_torque - q.friction)",
        "use 'moter_torque' in line 27, which is neither declared nor assigned before; did you "
        "mean 'motor_torque'",
    ),
    "reading that is missing": (
        "q.current_reading = q.current",
        "pass",
        "equations assign no 'current_reading', what the sensor 'current' reads",
    ),
    "text in place of a number": (
        "q.heat = q.resistance_now * q.current**2",
        "q.heat = 'hot'",
        "equations cannot be written out",
    ),
    "no number": (
        "q.heat = q.resistance_now * q.current**2",
        "q.heat = ca.log(-(q.current**2))",
        "equations make 'heat' something that is no number",
    ),
    "effect of another machine": (
        'name, equation = "stribeck", "friction"',
        'name, model, equation = "stribeck", "alsd", "friction"',
        "effects has 'stribeck' of model 'alsd'",
    ),
    "effect twice": (
        'name, equation = "stribeck"',
        'name, equation = "coulomb_change"',
        "effects names 'coulomb_change' twice",
    ),
    "part left out that is an effect": (
        "effects=(CoulombChange(), Stribeck(), CurrentGain()),",
        "effects=(CoulombChange(), Stribeck(), CurrentGain()),\n    unmodelled=(Stribeck(),),",
        "unmodelled has 'stribeck', which is one of the effects",
    ),
    "effect on a quantity that is not there": (
        '{"current_reading": "change"}',
        '{"curent_reading": "change"}',
        "effect 'current_gain' changes 'curent_reading'",
    ),
    "error term on a quantity that is not there": (
        '"current", {"back_emf"',
        '"current", {"emf"',
        "error term 'current' changes 'emf'",
    ),
    "delay of an unknown signal": ('late=("voltage"', 'late=("volts"', "delays 'volts'"),
    "covariate": ('"motor_torque": "Nm"', '"torque": "Nm"', "covariates"),
    "column of a sensor": (
        'Sensor("current", "A", "i", "winding")',
        'Sensor("current", "A", "i", "winding", mode="sliding")',
        "sensors read in mode 'sliding'",
    ),
    "gain of a fault": (
        'CoulombChange(), "change", 0.3',
        'CoulombChange(), "level", 0.3',
        "fault 'coulomb_change' has no gain 'level'",
    ),
    "piece that does not exist": (
        "    excitations=",
        "    excitation=",
        "there is no piece 'excitation'; did you mean 'excitations'",
    ),
    "comma that is missing": (
        "effects=(CoulombChange(), Stribeck(), CurrentGain()),",
        "effects=(CoulombChange()),",
        "machine 'servo': effects is one CoulombChange, expected several of Effect",
    ),
    "comma that is missing in the model": (
        'sensors=(cm.Sensor("speed", "rad/s", "ω", "shaft"), cm',
        'sensors=(cm.Sensor("speed", "rad/s", "ω", "shaft")), fast_while=(cm',
        "machine 'servo': sensors is one Sensor, expected several of Sensor",
    ),
    "class in place of an effect": (
        "(CoulombChange(), Stribeck(),",
        "(CoulombChange(), Stribeck,",
        "effects has Stribeck, expected Stribeck()",
    ),
    "names without what they stand for": (
        'covariates={"motor_torque": "Nm"}',
        'covariates=("motor_torque",)',
        "covariates is one tuple, expected names and what they stand for",
    ),
    "unit of a covariate": ('"motor_torque": "Nm"', '"motor_torque": "Nmx"', "motor_torque in"),
    "text in place of a noise": ("0.02, 1.0, 1.0", '"0.02", 1.0, 1.0', "process_noise = '0.02'"),
    "noise below 0": ("0.02, 1.0, 1.0", "-0.02, 1.0, 1.0", "process_noise = -0.02, expected a num"),
    "initial std below 0": ("0.02, 1.0, 1.0", "0.02, -1, 1.0", "current with initial_std = -1"),
    "gap of an input": ("gap=60.0", "gap=-1.0", "inputs has ambient_temp with gap = -1.0"),
    "longest step of 0": ("longest=(0.001, 0.001)", "longest=(0.0, 0.0)", "longest = (0.0, 0.0)"),
    "one longest step": ("longest=(0.001, 0.001)", "longest=0.001", "longest = 0.001, expected s"),
    "size of a fault with a sign": (
        '"change", 0.3, (16, 18)',
        '"change", -0.3, (16, 18)',
        "fault 'coulomb_change' has size -0.3, expected a magnitude above 0, and at most 2",
    ),
    "size of a fault that cannot be": (
        '"change", 0.3, (16',
        '"change", 3, (16',
        "has size 3, exp",
    ),
    "text in place of a size": (
        '"change", 0.3, (16',
        '"change", "0.3", (16',
        "has size '0.3', ex",
    ),
    "failure modes": ("(16, 18)", "16", "has fmi 16, expected two failure modes"),
    "failure modes that do not exist": ("(16, 18)", "(99, 18)", "has fmi (99, 18), expected two"),
    "rate of a state": (
        "q.temp_winding_rate =",
        "q.temp_winding_rte =",
        "assign 'temp_winding_rte', and no rate of state 'temp_winding'; did you mean 'temp_windin",
    ),
    "sensor in another unit than its state": (
        'cm.Sensor("speed", "rad/s"',
        'cm.Sensor("speed", "rpm"',
        "sensors read 'speed' in rpm, which is the state 'speed' in rad/s",
    ),
    "branch": (
        "q.motor_torque = q.torque_constant * q.current",
        "q.motor_torque = q.torque_constant * max(q.current, 0.0)",
        "cannot be written out in line 26: RuntimeError: an expression has no truth value; write",
    ),
    "function of CasADi that is not there": (
        "ca.tanh(q.speed / 2.0)",
        "ca.tan_h(q.speed / 2.0)",
        "cannot be written out in line 25: AttributeError: module 'casadi' has no attribute",
    ),
    "start of no state": (
        '{"temp_winding": inputs["ambient_temp"]}',
        '{"temp_windin": inputs["ambient_temp"]}',
        "at_rest has no state 'temp_windin'; did you mean 'temp_winding'",
    ),
    "start by no input": (
        '{"temp_winding": inputs["ambient_temp"]}',
        '{"temp_winding": inputs["ambient"]}',
        "at_rest asks for 'ambient', no parameter or input; did you mean 'ambient_temp'",
    ),
    "start that is no number": (
        '{"temp_winding": inputs["ambient_temp"]}',
        '{"temp_winding": "warm"}',
        "at_rest gives 'warm' for 'temp_winding', expected a number",
    ),
    "start that names no state": (
        '{"temp_winding": inputs["ambient_temp"]}',
        'inputs["ambient_temp"]',
        "at_rest gives one float, expected states and their values",
    ),
    "unit of an effect's number": (
        'cm.Number("change", "1", -0.3, 0.3)',
        'cm.Number("change", "Nmx", -0.3, 0.3)',
        "effect 'current_gain' has change in unknown unit 'Nmx'",
    ),
    "shape without a default": (
        "shape=True, default=10.0, grid",
        "shape=True, grid",
        "effect 'stribeck' has speed with default = 0, expected one between 2 and 50",
    ),
    "part left out that cannot be": (
        "effects=(CoulombChange(), Stribeck(), CurrentGain()),",
        "effects=(CoulombChange(), Stribeck()),\n    unmodelled=(type('Wrong', (CurrentGain,), "
        "{'scales': {'curent_reading': 'change'}})(),),",
        "effect 'current_gain' changes 'curent_reading'",
    ),
    "threshold": (
        '    covariates={"motor_torque": "Nm"},',
        '    regimes=cm.RegimeRules(thresholds=("lock_slp",)),',
        "regimes.thresholds has no threshold 'lock_slp'; did you mean 'lock_slip'",
    ),
    "anchor": ('anchor="speed"', 'anchor="velocity"', "have no column 'velocity' as their anchor"),
    "syntax": ("MACHINE = cm.Machine.of(", "MACHINE = cm.Machine.of((", "SyntaxError"),
    "exit": ("import casadi as ca", "raise SystemExit(3)", "SystemExit: 3"),
    "none": ("MACHINE = cm.Machine.of(", "machine = lambda: cm.Machine.of(", "it defines none"),
}


@pytest.mark.parametrize("what", DEFECTS)
def test_a_defect_is_one_line_that_names_the_piece(what, tmp_path):
    old, new, words = DEFECTS[what]
    assert TEXT.count(old) >= 1
    path = tmp_path / "servo.py"
    path.write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ClutchestError) as problem:
        machine_in_file(path)
    assert words in str(problem.value)
    assert "servo.py" in str(problem.value) and "\n" not in str(problem.value)


@pytest.mark.parametrize(
    ("written", "slip"),
    [
        ("i_rte", True),
        ("i_arte", True),
        ("ii_rate", True),
        ("i_rates", True),
        ("i_raze", True),
        ("i_rate", False),
        ("i_rt", False),
        ("flow_i_rate", False),
    ],
)
def test_one_letter_is_a_slip_of_the_pen(written, slip):
    assert one_slip(written, "i_rate") == slip


def test_functions_of_numpy_are_as_good(tmp_path, recwarn):
    """And CasADi's warning of what they will be in years is not the user's."""
    path = tmp_path / "servo.py"
    path.write_text(TEXT.replace("ca.tanh(q.speed / 2.0)", "np.tanh(q.speed / 2.0)"), "utf-8")
    machine = machine_in_file(path)
    assert [s.name for s in machine.states] == ["current", "speed", "temp_winding"]
    assert not [w for w in recwarn if issubclass(w.category, FutureWarning)]


def test_two_machines_in_one_file_are_refused(tmp_path):
    path = tmp_path / "servo.py"
    other = 'import dataclasses\nOTHER = dataclasses.replace(MACHINE, what="another")\n'
    path.write_text(TEXT + other, encoding="utf-8")
    with pytest.raises(ClutchestError, match=r"expected one clutchest\.machine"):
        machine_in_file(path)


def test_a_missing_file_has_its_likes_named(tmp_path):
    for name in ("servo.toml", "servo.dbc", "servo.py"):
        (tmp_path / name).write_bytes((SERVO / name).read_bytes())
    vehicle = tmp_path / "servo.toml"
    text = vehicle.read_text(encoding="utf-8").replace('"servo.py"', '"sevro.py"')
    vehicle.write_text(text, encoding="utf-8")
    with pytest.raises(ClutchestError, match=r"servo\.toml:3: no such file: sevro\.py"):
        load_vehicle(vehicle)


def test_a_changed_file_is_another_machine(tmp_path):
    path = tmp_path / "servo.py"
    path.write_text(TEXT, encoding="utf-8")
    before = machine_in_file(path)
    path.write_text(TEXT.replace("DC motor with a load", "DC motor"), encoding="utf-8")
    assert machine_in_file(path).what == "DC motor" != before.what


@pytest.mark.parametrize(
    ("verb", "lacks", "words"),
    [
        ("discover", "error_terms", "discover: machine 'servo' declares no error terms"),
        ("simulate", "excitations", "simulate: machine 'servo' declares no generator"),
    ],
)
def test_a_verb_says_which_piece_is_missing(verb, lacks, words):
    from dataclasses import replace

    machine = replace(machine_in_file(SERVO / "servo.py"), **{lacks: {}})
    with pytest.raises(ClutchestError, match=words):
        machine.supports(verb)


# --- registered by a package ----------------------------------------------------------------------


class Entry:
    """As importlib.metadata has them."""

    def __init__(self, name, load, value="package.module:MACHINE"):
        self.name, self.load, self.value = name, load, value


@pytest.fixture
def registered(monkeypatch):
    def register(*entries):
        def entry_points(group, name=None):
            assert group == "clutchest.machines"
            return [entry for entry in entries if name in (None, entry.name)]

        monkeypatch.setattr(models, "entry_points", entry_points)
        machine_of.cache_clear()

    yield register
    machine_of.cache_clear()


def test_an_entry_point_is_named_by_vehicle_files(registered, tmp_path):
    servo = machine_in_file(SERVO / "servo.py")
    registered(Entry("servo", lambda: servo))
    assert machine_of("servo") is servo and "servo" in models.names()
    text = (SERVO / "servo.toml").read_text(encoding="utf-8").replace('"servo.py"', '"servo"')
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    vehicle = load_vehicle(path)
    assert vehicle.machine is servo and vehicle.model_file is None
    assert importlib.metadata.entry_points is not models.entry_points


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (lambda: "no machine", "is a str, expected a clutchest.machine.Machine"),
        (lambda: 1 / 0, "ZeroDivisionError"),
        (lambda: exit(2), "SystemExit"),
    ],
)
def test_a_wrong_entry_point_is_one_line(registered, load, words):
    registered(Entry("servo", load))
    with pytest.raises(ClutchestError, match=words):
        machine_of("servo")


def test_a_name_that_two_packages_register_is_refused(registered):
    registered(Entry("servo", lambda: None, "a:M"), Entry("servo", lambda: None, "b:M"))
    with pytest.raises(ClutchestError, match=r"registered twice: a:M, b:M"):
        machine_of("servo")


@pytest.mark.parametrize("machine", models.shipped_machines(), ids=lambda machine: machine.name)
def test_the_equations_of_shipped_machines_are_sound(machine: Machine) -> None:
    """They are not tried at every start."""
    assert list(defects(machine)) == []


def test_a_column_is_not_lacking_where_others_stand_for_it() -> None:
    machine = machine_of("alsd")
    rig = {"slip_speed", "clutch_torque"}
    lacking = {column.name for column in machine.lacking(rig)}
    assert not lacking & {"wheel_speed_left", "wheel_speed_right", "shaft_torque"}
    assert {"armature_voltage", "drive_torque"} <= lacking
    car = {"wheel_speed_left", "wheel_speed_right", "shaft_torque"}
    lacking = {column.name for column in machine.lacking(car)}
    assert not lacking & {"slip_speed", "clutch_torque", "drive_torque", "drive_angle"}
    assert "slip_speed" in {column.name for column in machine.lacking({"wheel_speed_left"})}
