"""The manoeuvre that is proposed: chosen by the model, tested in the generator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from clutchest.discovery.candidates import CandidateCause, candidates
from clutchest.discovery.experiment_design import STEPS, beginning, propose
from clutchest.errors import ClutchestError
from clutchest.generator import Disturbances
from clutchest.inference.problem import Problem
from clutchest.models import machine_of
from clutchest.simulated import simulate
from clutchest.vehicle import Vehicle, load_vehicle

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SIZE = 0.1  # of the largest plausible one


def _white() -> Vehicle:
    truck = load_vehicle("truck")
    return replace(truck, signals={n: replace(s, noise_ar=0.0) for n, s in truck.signals.items()})


@pytest.mark.slow
def test_what_the_model_foresees_is_what_the_generator_s_drive_shows(monkeypatch):
    """The distance of a rival from a cause, foreseen by the program's equations from a healthy
    drive, is that which replays by the generator find in the drive with the cause."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from blind.drives import Drive
    from blind.oracle import Oracle

    @dataclass(frozen=True)
    class Nominal(Drive):
        def request(self, effects=None, outsider=None, scenario=None):
            return replace(
                super().request(effects, outsider),
                scenario="launches",
                seed=1,
                nominal=True,
                duration=None,
                disturbances=Disturbances(),
            )

    asked, vehicle = [], _white()
    machine = replace(machine_of(vehicle.model), scenarios=lambda: ("launches",))
    effects = tuple(machine.effects.values())

    def driven(name):
        asked.append(name)
        return simulate(vehicle, name, 1, nominal=True)

    found = {c.name: c for c in candidates(Problem.of(driven("launches"), vehicle, effects))}
    late = 3.0 * SIZE  # a healthy truck's signals may be late by a part of that
    rivals = [(found[name], late) for name in ("torque_delay", "position_delay")]
    words = propose(
        rivals, [], machine, driven, lambda signals: Problem.of(signals, vehicle, effects)
    )
    assert words.words.endswith(vehicle.machine.manoeuvres["launches"])
    assert words.scenario == "launches" and asked == ["launches"] * 2
    told = float(words.words.split(" by ")[1].split()[0])
    oracle, off = Oracle(Nominal(1, "white")), []
    for (cause, size), (rival, _) in (rivals, rivals[::-1]):
        twin = oracle.twin({cause.name: {cause.gain.key: size * cause.gain.upper}})
        off.append(oracle.distance(twin, [rival.name]))
    assert min(off) == pytest.approx(told, rel=0.3)


@pytest.mark.parametrize("name", ["dry_clutch", "alsd"])
def test_every_manoeuvre_is_said_in_words_that_can_be_driven(name):
    machine = machine_of(name)
    assert set(machine.manoeuvres) == set(machine.scenarios())


def test_a_manoeuvre_is_judged_by_its_beginning():
    drive = simulate("alsd_rig", "rig-steps", 1, duration=5.0)
    assert len(beginning(drive, 6.0 / STEPS)["motor_angle"]) == len(drive["motor_angle"])
    first = min(signal.time[0] for signal in drive.values())
    part = beginning(drive, 2.0 / STEPS)
    assert part.end == pytest.approx(first + 2.0)
    for name, signal in drive.items():
        assert len(part[name].time) == (signal.time < first + 2.0).sum()


def test_experiments_on_other_benches_are_not_simulated():
    machine, asked = machine_of("alsd"), []
    effects = [machine.effects[name] for name in ("friction_level", "pack_stiffness")]
    rivals = [(CandidateCause(effect, effect.gains[0], 0, ()), SIZE) for effect in effects]

    def refused(name):
        asked.append(name)
        raise ClutchestError("no such rig")

    propose(rivals, [], machine, refused, lambda signals: None)
    apart = {"I1", "I2", "I3", "I4", "I5", "I6"}  # I7 is with the pack in part
    assert set(asked) == set(machine.scenario_names) - apart


def test_a_sensor_is_proposed_where_no_manoeuvre_can_be_simulated():
    vehicle = _white()
    machine = machine_of(vehicle.model)
    effects = [machine.effects[name] for name in ("friction_level", "torque_gain")]
    rivals = [(CandidateCause(effect, effect.gains[0], 0, ()), SIZE) for effect in effects]

    def refused(name):
        raise ClutchestError("no such road")

    words = propose(rivals, [], machine, refused, lambda signals: None)
    assert words.scenario is None and "no such road" in words.words
    assert "torque sensor" in words.words
