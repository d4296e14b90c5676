from __future__ import annotations

import ast
import inspect
import re
from dataclasses import fields, replace
from pathlib import Path

import pytest

from clutchest.can.database import DatabaseFile
from clutchest.errors import ClutchestError
from clutchest.models import machine_of
from clutchest.models.thresholds import THRESHOLD_UNITS
from clutchest.shipped import shipped
from clutchest.vehicle import Vehicle, dump_vehicle, load_vehicle


@pytest.mark.parametrize("name", sorted(shipped("vehicles")))
def test_every_shipped_vehicle_is_complete_and_reads_back_equal(name: str, tmp_path: Path) -> None:
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert set(vehicle.parameters) == {p.key for p in machine_of(vehicle.model).parameters}
    assert all(p.source for p in vehicle.parameters.values()), "a number without a source"
    copy = tmp_path / "deep" / "copy.toml"
    copy.parent.mkdir()
    dump_vehicle(vehicle, copy, heading="identified\nfrom a log")
    assert copy.read_text(encoding="utf-8").startswith("# identified\n# from a log\nname")
    assert load_vehicle(copy) == vehicle


def test_the_trucks_numbers_are_those_of_the_papers_trial(truck: Vehicle) -> None:
    value = {key: p.value for key, p in truck.parameters.items()}
    assert value["heat_capacity_body"] == 40500.0  # 81 kg · 500 J/(kg K), given in kJ/K
    assert truck.parameters["heat_capacity_body"].spread == pytest.approx(1600.0)
    assert (value["torque_cubic"], value["torque_quadratic"], value["kiss_point"]) == (
        -21.0,
        38.7,
        6.51,
    )
    disc = value["heat_capacity_disc"] / value["conductance_disc_body"]
    body = value["heat_capacity_body"] / (
        value["conductance_engine_body"] + value["conductance_body_housing"]
    )
    assert body / disc == pytest.approx(50, rel=0.02)  # ME12 § V-C
    assert truck.guessed == ()
    assert len(load_vehicle("gt350").guessed) == len(truck.parameters)


def test_units_are_converted_to_the_models_own(edited) -> None:
    path = edited(
        ('value = 126, unit = "W/K", spread = 12.6', 'value = 0.126, unit = "kW/K", spread = 0.01'),
        ('value = 70, unit = "°C", spread = 0,', 'value = 158, unit = "°F", spread = 9,'),
        ('{ value = 3500.0, unit = "Nm" }', "3500"),
        ("kiss_point = { value = 6.51", "kiss_point = 6.4\n#"),
        ('wear = { value = 3.0, unit = "mm" }', 'wear = { value = 0.3e-2, unit = "m" }'),
        extra='[modes]\nlock_slip = { value = 20, unit = "rpm" }\nlock_time = 0.2\n',
    )
    vehicle = load_vehicle(path)
    conductance = vehicle.parameters["conductance_disc_body"]
    assert (conductance.value, conductance.spread) == pytest.approx((126.0, 10.0))
    assert conductance.unit == "W/K"
    temperature = vehicle.parameters["reference_temp"]
    assert (temperature.value, temperature.spread) == pytest.approx((70.0, 5.0))
    assert vehicle.signals["engine_torque"].reference == 3500.0
    assert vehicle.parameters["kiss_point"].value == 6.4
    assert vehicle.limits["wear"].value == pytest.approx(3.0)
    assert vehicle.modes == pytest.approx({"lock_slip": 2.0943951, "lock_time": 0.2})


def line_of(path: Path, text: str) -> int:
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if text in line:
            return number
    raise AssertionError(text)


KISS = 'kiss_point = { value = 6.51, unit = "mm"'
# What is changed, a text on the line that the message must name, and the message.
WRONG = [
    (
        ("[signals.slave_position]", "[signals.slave_positon]"),
        "slave_positon]",
        r"unknown signal of 'dry_clutch' 'slave_positon'; did you mean 'slave_position'",
    ),
    (
        ('signal = "MotorPosition"', 'signl = "MotorPosition"'),
        "signl",
        r"unknown key 'signl'; did you mean .*'signal'",
    ),
    (
        ('name = "truck"', 'name = "truck"\nmodle = 1'),
        "modle",
        r"unknown key 'modle'; did you mean .*'model'",
    ),
    (
        ("delay_spread = 0.008", "delay_spread = 0.0"),
        "delay_spread",
        r"signals\.engine_torque\.delay_spread = 0 must be",
    ),
    (
        ('model = "dry_clutch"', 'model = "dryclutch"'),
        "dryclutch",
        r"unknown model 'dryclutch'; did you mean 'dry_clutch'\?",
    ),
    (
        ("expansion_disc = {", "expansion_disk = {"),
        "expansion_disk",
        r"unknown parameter 'expansion_disk'; did you mean 'expansion_disc'",
    ),
    ((KISS, KISS + ", spraed = 1"), KISS, r"unknown key 'spraed'; did you mean 'spread'\?"),
    (
        (KISS, 'kiss_point = { value = 6.51, unit = "Nm"'),
        "kiss_point = {",
        r"unit 'Nm' of parameters\.kiss_point cannot be converted to 'mm'",
    ),
    (
        (KISS, 'kiss_point = { value = 6.51, unit = "milimeter"'),
        "kiss_point = {",
        r"unknown unit 'milimeter'",
    ),
    (
        (KISS, 'kiss_point = { value = nan, unit = "mm"'),
        "kiss_point = {",
        r"parameters\.kiss_point\.value = nan is not finite",
    ),
    ((KISS, 'kiss_point = { value = inf, unit = "mm"'), "kiss_point = {", r"inf is not finite"),
    (
        (KISS, 'kiss_point = { value = "6", unit = "mm"'),
        "kiss_point = {",
        r"kiss_point\.value must be a number, not '6'",
    ),
    (
        (KISS, 'kiss_point = { unit = "mm"'),
        "kiss_point = {",
        r"parameters\.kiss_point has no 'value' \(in mm\)",
    ),
    (
        ("torque_cubic = { value = -21.0", "torque_cubic = { value = 21.0"),
        "torque_cubic",
        r"parameters\.torque_cubic = 21 must be at most 0",
    ),
    (("spread = 0.02", "spread = -0.02"), "kiss_point = {", r"spread = -0.02 must be at least 0"),
    (
        ('unit = "rpm"\nnoise = 0.06', 'unit = "rpm"'),
        "[signals.engine_speed]",
        r"signals\.engine_speed has no 'noise'",
    ),
    (
        ('unit = "rpm"\nnoise = 0.06', 'unit = "km/h"\nnoise = 0.06'),
        'unit = "km/h"',
        r"unit 'km/h' of signals\.engine_speed cannot be converted to 'rad/s'",
    ),
    (
        ('unit = "%"\n', 'unit = "Nm"\n'),
        "reference = { value = 3500",
        r"engine_torque\.reference says what 100 % stands for, and .* is not in %",
    ),
    (("noise_ar = 0.9", "noise_ar = 1.0"), "noise_ar", r"noise_ar must be smaller than 1"),
    (
        ('checked = ["ClutchActuator"]', 'checked = ["ClutchActutor"]'),
        "checked",
        r"unknown mapped message 'ClutchActutor'; did you mean 'ClutchActuator'\?",
    ),
    (
        ("false_alarms_per_1000h", "false_alarms"),
        "false_alarms",
        r"unknown key 'false_alarms'; did you mean 'false_alarms_per_1000h'\?",
    ),
    (
        ("[limits]", "[effects]\nwaer = { rate = 0.1 }\n\n[limits]"),
        "waer",
        r"unknown effect of 'dry_clutch' 'waer'; did you mean 'wear'",
    ),
    (
        ("[limits]", "[effects]\nwear = { rat = 0.1 }\n\n[limits]"),
        "wear = { rat",
        r"unknown parameter of effect 'wear' 'rat'; did you mean 'rate'\?",
    ),
    (
        ("[limits]", "[effects]\nwear = { rate = -0.1 }\n\n[limits]"),
        "wear = { rate",
        r"effects\.wear\.rate = -0\.1 must be at least 0",
    ),
    (
        ("[limits]", "[effects]\nfriction_slip = { change = 0.1, speed = 0 }\n\n[limits]"),
        "friction_slip =",
        r"effects\.friction_slip\.speed = 0 must be at least",
    ),
    (
        (
            "[limits]",
            "[effects]\nwear = { rate = 0.1 }\n[effects_spread]\nwaer = { rate = 1 }\n[limits]",
        ),
        "waer",
        r"unknown effect of \[effects\] 'waer'; did you mean 'wear'\?",
    ),
    (
        (
            "[limits]",
            "[effects]\nwear = { rate = 0.1 }\n\n[effects_spread.wear]\namount = 1\n\n[limits]",
        ),
        "amount = 1",
        r"unknown number in \[effects\] of 'wear' 'amount'; valid: rate",
    ),
    (
        (
            "[limits]",
            "[effects.friction_fade]\nslope = 0.1\nonset = { value = 250, spread = 9 }\n\n[limits]",
        ),
        "onset",
        r"friction_fade\.onset is a shape and takes no spread",
    ),
    (
        ("friction = { wander", "frictoin = { wander"),
        "frictoin",
        r"unknown state 'frictoin'; did you mean 'friction'\?",
    ),
    (
        ("{ wander = 5e-4 }", '{ role = "adaptiv" }'),
        "adaptiv",
        r"unknown role 'adaptiv'; did you mean 'adaptive'\?",
    ),
    (
        ("[limits]", "[healthy]\nheat_splt = { fraction = 0.05 }\n\n[limits]"),
        "heat_splt",
        r"unknown effect 'heat_splt'; did you mean 'heat_split'",
    ),
    (
        ("[limits]", "[healthy]\nheat_split = { fracton = 0.05 }\n\n[limits]"),
        "heat_split",
        r"unknown gain of 'heat_split' 'fracton'; did you mean 'fraction'\?",
    ),
    (
        ("[limits]", "[smooth_errors.torqe]\n\n[limits]"),
        "torqe",
        r"unknown error term 'torqe'; did you mean 'torque' or ",
    ),
    (
        ("compression = {", "compresion = {"),
        "compresion",
        r"unknown covariate 'compresion'; did you mean 'compression'\?",
    ),
    (
        ("compression = { std = 1.0, length = 0.8 }", "compression = { std = 1.0 }"),
        "compression = { std",
        r"smooth_errors\.torque\.compression has no 'length'",
    ),
    (
        ("compression = { std = 1.0, length = 0.8 }", "compression = { std = 1, length = 0 }"),
        "compression = { std",
        r"smooth_errors\.torque\.compression\.length",
    ),
    (
        ("[limits]", '[modes]\nlock_slip = { value = 1, unit = "s" }\n\n[limits]'),
        "lock_slip",
        r"unit 's' of modes\.lock_slip cannot be converted to 'rad/s'",
    ),
    (
        (
            'signal = "SlavePosition"\nunit = "mm"',
            'signal = "SlavePosition"\nunit = "%" # of the stroke',
        ),
        "# of the stroke",
        r"'%' of signals\.slave_position cannot .* 'reference' states what 100 % stands for, in mm",
    ),
    (
        ('signal = "MotorPosition"', 'signal = "MotorPosition"\nreference = "50"'),
        'reference = "50"',
        r"motor_position\.reference must be a number",
    ),
    (
        ("checked =", 'effects_files = ["no.py"]\nchecked ='),
        "effects_files",
        r"no such file: no\.py \(relative to this vehicle file\)",
    ),
    (
        ('dbc = ["hdt_clutch.dbc"]', 'dbc = [{ file = "hdt_clutch.dbc", chanel = 1 }]'),
        "dbc",
        r"unknown key 'chanel'; did you mean 'channel'\?",
    ),
    (
        ('dbc = ["hdt_clutch.dbc"]', 'dbc = [{ file = "hdt_clutch.dbc" }]'),
        "dbc",
        r"an entry of dbc has no 'channel'",
    ),
    (
        ('dbc = ["hdt_clutch.dbc"]', 'dbc = { file = "hdt_clutch.dbc", channel = 1 }'),
        "dbc",
        r'dbc must be a list of names, or of \{ file = "a\.dbc", channel = 0 \}',
    ),
    (("[limits]", "[limits"), "[limits", r"not TOML: "),
]


@pytest.mark.parametrize(("change", "where", "message"), WRONG, ids=[m for _, _, m in WRONG])
def test_complaints_name_file_line_key_and_the_nearest(edited, change, where, message) -> None:
    path = edited(change)
    with pytest.raises(ClutchestError, match=message) as caught:
        load_vehicle(path)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"mine.toml:{line_of(path, where)}: ")


def test_a_missing_parameter_is_named_with_its_unit(edited) -> None:
    path = edited(("kiss_point = {", "# {"))
    with pytest.raises(ClutchestError, match=r"parameter 'kiss_point' \(.*, in mm\) is missing"):
        load_vehicle(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "x"\nmodel = "dry_cluch"\n', "^v.toml:2: unknown model 'dry_cluch'; did you mean"),
        ('name = "x"\nmodel = "dry_clutch"\n', "^v.toml: this vehicle file has no 'parameters'$"),
        ('name = "x"\n[parameters]\n', "^v.toml: this vehicle file has no 'model'$"),
    ],
)
def test_the_machine_is_judged_before_what_it_needs(tmp_path, text, message) -> None:
    path = tmp_path / "v.toml"
    path.write_text(text)
    with pytest.raises(ClutchestError, match=message):
        load_vehicle(path)


def test_an_unknown_vehicle_names_the_nearest_shipped_one() -> None:
    with pytest.raises(ClutchestError, match="no such file: trukc; did you mean 'truck'"):
        load_vehicle("trukc")


def test_text_that_is_not_utf8_names_its_line(tmp_path: Path) -> None:
    path = tmp_path / "latin.toml"
    path.write_bytes('name = "x"\nmodel = "dry_clutch" # °C\n'.encode("latin-1"))
    with pytest.raises(ClutchestError, match=r"^latin\.toml:2: not UTF-8 text$"):
        load_vehicle(path)


def test_gears_must_fall(edited) -> None:
    path = edited(('signal = "InputShaftSpeed"', 'signal = "InputShaftSpeed"\ngears = [3.0, 4.0]'))
    with pytest.raises(ClutchestError, match="must fall from the first gear to the last"):
        load_vehicle(path)
    path = edited(
        (
            'signal = "InputShaftSpeed"',
            'signal = "InputShaftSpeed"\ngear = { message = "ETC2", signal = "CurrentGear" }',
        )
    )
    with pytest.raises(ClutchestError, match=r"input_shaft_speed\.gear requires 'gears' beside it"):
        load_vehicle(path)


def test_every_effect_of_the_library_can_stand_in_a_file(edited, tmp_path: Path) -> None:
    effects = {
        name: {number.key: number.upper for number in effect.parameters}
        for name, effect in machine_of("dry_clutch").effects.items()
    }
    lines = [
        f"{name} = {{ {', '.join(f'{k} = {v}' for k, v in values.items())} }}"
        for name, values in effects.items()
    ]
    vehicle = load_vehicle(edited(extra="[effects]\n" + "\n".join(lines) + "\n"))
    assert vehicle.effects == effects and vehicle.effects_spread == {}
    dump_vehicle(vehicle, tmp_path / "copy.toml")
    assert load_vehicle(tmp_path / "copy.toml") == vehicle


def test_a_gain_has_its_spread_beside_it_or_in_a_table(edited, tmp_path: Path) -> None:
    beside = "wear = { rate = { value = 20, unit = 'µm/MJ', spread = 3 }, amount = 1 }"
    apart = "wear = { rate = 0.02, amount = 1 }\n[effects_spread]\nwear = { rate = 0.003 }"
    for text in (beside, apart):
        vehicle = load_vehicle(edited(extra=f"[effects]\n{text}\n"))
        assert vehicle.effects == {"wear": {"rate": pytest.approx(0.02), "amount": 1.0}}
        assert vehicle.effects_spread == {"wear": {"rate": pytest.approx(0.003)}}
        dump_vehicle(vehicle, tmp_path / "copy.toml")
        assert load_vehicle(tmp_path / "copy.toml") == vehicle


def test_a_users_own_effects_are_known_and_enter_the_hash(edited, tmp_path: Path) -> None:
    source = tmp_path / "mine.py"
    source.write_text(
        "from clutchest.models.effects import Effect, Number\n"
        "class Humidity(Effect):\n"
        "    name, model, equation = 'humidity', 'dry_clutch', 'torque'\n"
        "    parameters = (Number('change', '1', -0.1, 0.1),)\n"
    )
    path = edited(
        ("checked =", 'effects_files = ["mine.py"]\nchecked ='),
        extra="[effects]\nhumidity = { change = 0.05 }\n",
    )
    vehicle = load_vehicle(path, trust=True)
    assert vehicle.effects == {"humidity": {"change": 0.05}}
    other = tmp_path / "other"
    other.mkdir()
    dump_vehicle(vehicle, other / "v.toml")
    assert load_vehicle(other / "v.toml", trust=True) == vehicle
    assert (other / "mine.py").read_text() == source.read_text()
    source.write_text(source.read_text() + "# edited\n")
    assert load_vehicle(path, trust=True).hash != vehicle.hash


def test_strange_texts_and_numbers_survive_the_writing(truck: Vehicle, tmp_path: Path) -> None:
    kiss = replace(
        truck.parameters["kiss_point"],
        value=6.123456789012345e-7,
        source='says "so"\\ and\nmore\t°',
    )
    odd = replace(truck, parameters={**truck.parameters, "kiss_point": kiss})
    dump_vehicle(odd, tmp_path / "odd.toml")
    assert load_vehicle(tmp_path / "odd.toml") == odd


def test_a_shipped_dbc_by_its_name(tmp_path: Path) -> None:
    text = load_vehicle("truck").path.read_text()
    named = text.replace('dbc = ["hdt_clutch.dbc"]', 'dbc = ["hdt_clutch"]')
    assert named != text
    (tmp_path / "own.toml").write_text(named)
    assert load_vehicle(tmp_path / "own.toml").dbc == load_vehicle("truck").dbc


def test_a_missing_dbc_waits_for_the_log() -> None:
    assert load_vehicle("gt350").dbc == (DatabaseFile(Path("ford_lincoln_base_pt.dbc")),)
    assert re.fullmatch("[0-9a-f]{64}", load_vehicle("gt350").hash)


def test_the_files_thresholds_are_those_of_the_modes(edited) -> None:
    from clutchest.models.thresholds import Thresholds

    assert set(THRESHOLD_UNITS) == {field.name for field in fields(Thresholds)}
    text = "[modes]\n" + "".join(f"{name} = 0.25\n" for name in THRESHOLD_UNITS)
    assert Thresholds.of(load_vehicle(edited(extra=text)).modes).gap == 0.25


def test_a_threshold_that_the_machine_does_not_use_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    text = shipped("vehicles")["alsd_rig"].read_text(encoding="utf-8")
    path.write_text(text + "\n[modes]\nguard = 0.2\n", encoding="utf-8")
    assert load_vehicle(path).modes == {"guard": 0.2}
    path.write_text(text + "\n[modes]\nlock_slip = 2.0\n", encoding="utf-8")
    with pytest.raises(ClutchestError) as caught:
        load_vehicle(path)
    line = len(text.splitlines()) + 3
    assert str(caught.value) == (
        f"mine.toml:{line}: unknown threshold of 'alsd' 'lock_slip'; valid: gap, guard"
    )


@pytest.mark.parametrize("name", ["dry_clutch", "alsd"])
def test_the_thresholds_of_a_machine_are_those_that_its_regimes_read(name: str) -> None:
    """By the syntax tree: an attribute of ``thresholds`` that is read is declared."""
    rules = machine_of(name).regimes
    tree = ast.parse(inspect.getsource(inspect.getmodule(rules.judge)))
    read = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr in THRESHOLD_UNITS
    }
    assert read == set(rules.thresholds)
