"""What a verb says that it expects, where it was given something else."""

from __future__ import annotations

import math
import sys

import click
import pytest

from clutchest import cli
from clutchest.reading.table_formats import table_formats
from clutchest.shipped import shipped
from clutchest.vehicle import load_vehicle

SIMULATE = ("--scenario", "launches", "--seed", "1", "-o", "x.log")


@pytest.fixture
def refused(monkeypatch, capsys):
    """What a command line that fails says on stderr."""

    def call(*arguments) -> str:
        monkeypatch.setattr(sys, "argv", ["clutchest", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert end.value.code
        return capsys.readouterr().err

    return call


@pytest.mark.parametrize(
    ("name", "content"), [("log.xyz", b"hello\n"), ("log.xyz", b""), ("log.csv", b"")]
)
@pytest.mark.parametrize(
    "verb",
    [
        ["replay", "LOG", "--vehicle", "truck"],
        ["inspect", "LOG"],
        ["convert", "LOG", "-o", "x.asc"],
    ],
)
def test_tables_are_named_where_they_are_taken(refused, tmp_path, verb, name, content):
    log = tmp_path / name
    log.write_bytes(content)
    said = refused(*(log if part == "LOG" else part for part in verb))
    assert "expected a CAN log" in said and "or a table of decoded signals (" in said
    for suffix in (kind.suffixes[0] for kind in table_formats() if kind.read):
        assert suffix in said.partition("a table of decoded signals")[2], suffix


def test_tables_are_not_named_where_they_are_not_taken(refused, tmp_path):
    log = tmp_path / "log.xyz"
    log.write_bytes(b"hello\n")
    said = refused("play", log, "-i", "virtual", "-c", "x")
    assert "expected a CAN log (" in said and "decoded signals" not in said


@pytest.mark.parametrize("given", ["nan", "inf", "-1"])
@pytest.mark.parametrize(
    ("verb", "option"),
    [
        (["replay", "demo", "--vehicle", "truck"], "--rate"),
        (["fleet", ".", "--vehicle", "truck"], "--rate"),
        (["monitor", "--vehicle", "truck", "-i", "virtual"], "--rate"),
        (["monitor", "--vehicle", "truck", "-i", "virtual"], "--duration"),
        (["play", "demo", "-i", "virtual"], "--speed"),
        (["simulate", "--vehicle", "truck", *SIMULATE], "--duration"),
        (["simulate", "--vehicle", "truck", *SIMULATE], "--onset"),
    ],
)
def test_what_is_no_number_of_the_range(refused, verb, option, given):
    said = refused(*verb, option, given)
    assert f"'{option}': {given}; expected a number " in said


@pytest.mark.parametrize(("option", "kind"), [("--duration", "number"), ("--seed", "whole number")])
def test_what_is_no_number_at_all(refused, option, kind):
    said = refused("simulate", "--vehicle", "truck", *SIMULATE, option, "abc")
    assert f"'{option}': 'abc' is not a valid {kind}." in said


def test_every_option_that_takes_a_number_takes_a_finite_one():
    """Without a check Click would take nan."""
    options = [option for verb in cli.app.commands.values() for option in verb.params]
    numbers = [o for o in options if isinstance(o.default, float) or o.name == "duration"]
    assert len(numbers) >= 7
    for option in numbers:
        for bad in (math.nan, math.inf):
            with pytest.raises(click.BadParameter, match="expected a number"):
                option.callback(None, option, bad)


@pytest.mark.parametrize("verb", ["replay", "diagnose", "discover", "fleet", "export", "monitor"])
def test_shipped_vehicles_are_named_where_none_is_given(refused, verb):
    said = refused(verb, *([] if verb in ("export", "monitor") else ["demo"]))
    assert "--vehicle" in said.partition("Error: Missing: ")[2].partition(";")[0]
    assert f"; shipped vehicles: {', '.join(shipped('vehicles'))}" in said


def test_all_that_is_missing_is_named_at_once(refused):
    said = refused("replay").splitlines()[-1]
    assert said.startswith("Error: Missing: LOG, --vehicle; shipped vehicles: ")
    assert refused("convert", "demo").splitlines()[-1] == "Error: Missing: -o"


@pytest.mark.parametrize("vehicle", ["truck", "alsd_rig", "alsd_car"])
def test_simulate_names_the_scenarios_of_the_vehicle(refused, vehicle, tmp_path):
    said = refused("simulate", "--vehicle", vehicle).splitlines()[-1]
    head, named = said.split(f"; scenarios of {load_vehicle(vehicle).name}: ")
    assert head == "Error: Missing: --scenario, -o"
    others = ("--seed", "1", "-o", tmp_path / "x.log")
    unknown = refused("simulate", "--vehicle", vehicle, "--scenario", "qqqq", *others)
    assert sorted(named.split(", ")) == sorted(unknown.strip().split("; valid: ")[1].split(", "))


@pytest.mark.parametrize("verb", [["convert", "-o", "x.asc"], ["inspect"]])
def test_a_log_given_twice(refused, tmp_path, monkeypatch, verb):
    monkeypatch.chdir(tmp_path)
    assert "demo.log.gz: given twice; expected each log once" in refused(*verb, "demo", "demo")
    assert refused(*verb, "") == "clutchest: a file name is empty\n"
    assert not list(tmp_path.iterdir())


def test_a_request_without_a_number_says_so(refused, tmp_path):
    request = tmp_path / "request.csv"
    request.write_text("time,torque_request\n0,abc\n")
    said = refused("feedforward", request, "--vehicle", "alsd_rig", "--out", tmp_path / "out")
    assert "request.csv: row 2: torque_request 'abc' is not a number (1 such cell)" in said


def test_simulate_without_anything_names_all_of_it(refused):
    said = refused("simulate").splitlines()[-1]
    assert said.startswith("Error: Missing: --vehicle, --scenario, -o; shipped vehicles: ")
    said = refused("simulate", "--vehicle", "truk", "--seed", "1").splitlines()[-1]
    assert said.startswith("Error: Missing: --scenario, -o; ")
    assert said.endswith("truk; did you mean 'truck'?")


def test_a_wrong_value_before_what_is_missing(refused):
    said = refused("replay", "--rate", "0").splitlines()[-1]
    assert "'--rate': 0; expected a number" in said and "Missing" not in said
