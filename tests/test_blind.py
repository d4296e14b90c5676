"""The blind suite itself: what it hides stays hidden, its cases are the same every time, its
outsiders act as they say, and its table adds up."""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, chi2

import clutchest
from clutchest.models import machine_of

SECONDS = 420.0  # long enough for every outsider to act
BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module", autouse=True)
def blind() -> Iterator[None]:
    """The suite stands beside the benchmarks, not in the package."""
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


def test_a_sealed_answer_comes_back_and_says_nothing_before(tmp_path):
    from blind.sealed import seal, unseal

    answer = {"effects": {"friction_fade": {"slope": 0.1234567890123}}, "outsider": None}
    seal(answer, tmp_path / "a")
    text = (tmp_path / "a").read_text()
    assert "friction" not in text and "0.123" not in text
    assert unseal(tmp_path / "a") == answer
    body, digest = text.split()
    (tmp_path / "a").write_text(f"{body[:-8]}AAAA{body[-4:]}\n{digest}\n")
    with pytest.raises(ValueError, match="a: "):
        unseal(tmp_path / "a")
    (tmp_path / "a").write_text(f"{body}\n{digest[::-1]}\n")
    with pytest.raises(ValueError, match="has been changed"):
        unseal(tmp_path / "a")


def test_the_plan_holds_what_it_must():
    from blind.near_misses import NEAR_MISSES
    from blind.outsiders import OUTSIDERS
    from blind.plan import ALL, PARTS, SIZES, Case, drawn, each, full, gains, quick

    from clutchest.generator import GROUPS

    cases = full()
    assert len({case.name for case in cases}) == len({case.seed for case in cases}) == len(cases)
    assert set(SIZES) >= {2, 3, 4, 5, 6, 12, 20}
    for gain in gains():
        of = [case for case in cases if case.cause == gain]
        assert all(sum(case.d_prime == size for case in of) >= 20 for size in SIZES)
        assert len({case.noise for case in of}) == 5
    for noise in ("white", "ar05", "ar09", "quantised", "outliers"):
        assert sum(case.part == "null" and case.noise == noise for case in cases) >= 1000
    assert len(OUTSIDERS) >= 8
    assert len({kind.equation for kind in OUTSIDERS.values()}) >= 7
    few = quick()
    assert len(few) >= 120 and few == quick()
    assert {case.cause for case in few if case.part == "outsider"} == set(OUTSIDERS)
    assert {case.cause for case in few if case.part == "effect"} == set(gains())
    fresh = {case.seed for case in full(first=1000)}
    assert len(fresh) == len(cases) and not fresh & {case.seed for case in cases}
    groups = [case.cause for case in cases if case.part == "mismatch"]
    assert len(groups) >= 300 and min(map(groups.count, groups)) >= 20
    assert set(groups) == {*GROUPS, ALL}
    assert Case("mismatch", ALL, 0.0, "white", 1000).drive().mismatches == tuple(GROUPS)
    assert Case("null", "", 0.0, "white", 1000).drive().mismatches == ()
    few_each = each(["mismatch", "near-miss"], 3)
    assert set(few_each) == {
        *each(["mismatch", "near-miss"], 1),
        *each(["mismatch", "near-miss"], 2, after=1),
    }
    kinds = [case.cause for case in few_each]
    assert {kinds.count(kind) for kind in kinds} == {3} and set(kinds) > {*GROUPS, *NEAR_MISSES}
    assert drawn(PARTS, 50) == drawn(PARTS, 80)[:50]
    assert 20 <= sum(case.part == "null" for case in drawn(PARTS, 80)) <= 60


@pytest.mark.parametrize(
    "file", ["outsiders.py", "unlisted.py", "near_misses.py", "differential_outsiders.py"]
)
def test_outsiders_know_nothing_of_the_package(file):
    tree = ast.parse((BENCHMARKS / "blind" / file).read_text())
    imported = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import)
        for alias in node.names
    }
    imported |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert imported <= {
        "__future__",
        "blind.outsiders",
        "blind.unlisted",
        "collections.abc",
        "dataclasses",
        "math",
        "typing",
        "numpy",
        "numpy.typing",
        "scipy.signal",
    }


def test_outsiders_are_none_of_the_library_and_their_drivers_are_known():
    from blind.near_misses import FOREIGN

    known = set(machine_of("dry_clutch").units)
    known |= {state.name for state in machine_of("dry_clutch").states}
    known |= {"slip_speed", "position_rate", "energy", "time"}
    known |= {"clutch_torque", "input_shaft_rate", "slip_power", "slip_rate", "rest_time"}
    known |= {"engagements", "engine_acceleration", "vehicle_acceleration", "slip_angle"}
    known |= {"recent_slip", "recent_movement", "engine_torque_rate"}
    known |= {"gear", "recent_torque", "recent_travel"}
    assert not set(FOREIGN) & set(machine_of("dry_clutch").effects)
    for kind in FOREIGN.values():
        assert set(kind.drivers) <= known and kind.largest > 0 and kind.__doc__


@pytest.mark.parametrize(("reached", "suits"), [(4.0, False), (6.0, True)])
def test_neither_of_a_pair_is_next_to_nothing_beside_the_other(reached, suits):
    """In full, unlike to first order, one may take the other's place."""
    from blind import cases
    from blind.plan import Case

    class Oracle:
        def per_largest(self, gain, other):
            return 20.0

        def twin(self, effects):
            return effects

        def distance(self, twin, beside):
            return reached if beside == ["friction_level"] else 10.0

        def nearest(self, twin, beside):
            return {"wear": 3.0, "torque_gain": 4.0, "friction_level": 4.0}

        def excited(self):
            return {}

    case, rng = Case("two", "", 10.0, "white", 1), np.random.default_rng(1)
    pair = ["torque_gain.change", "friction_level.change"]
    assert bool(cases._pair(case, Oracle(), pair, rng)) == suits


@pytest.fixture(scope="module")
def drives() -> Any:
    """``drives(outsider)``: exact readings and truth of one drive."""
    from dataclasses import replace

    truck = clutchest.load_vehicle("truck")
    quiet = {name: replace(s, noise=0.0) for name, s in truck.signals.items()}
    vehicle = replace(truck, signals=quiet)

    def made(outsider: Any = None) -> Any:
        from clutchest.simulated import simulate_sampled

        return simulate_sampled(vehicle, "mixed", 1, outsider=outsider, duration=SECONDS)

    return made


@pytest.fixture(scope="module")
def plain(drives) -> Any:
    return drives()


def _outsiders() -> list[str]:
    names = ast.parse((BENCHMARKS / "blind" / "outsiders.py").read_text())
    return [node.name for node in names.body if isinstance(node, ast.ClassDef) and node.bases]


@pytest.mark.slow
@pytest.mark.parametrize("name", _outsiders())
def test_an_outsider_acts_where_it_says(drives, plain, name):
    """What falsifies a sensor or its timing leaves the truck alone, and the other sensors; what
    acts on the truck leaves every sensor right.  At size 0 nothing changes."""
    from blind import outsiders

    kind = getattr(outsiders, name)
    wrong = drives(kind(kind.largest / 3))
    reading = kind.equation.startswith(("sensor:", "timing:"))
    moved = [
        c
        for c, column in plain.truth.columns.items()
        if c != "mode" and not np.array_equal(column, wrong.truth.columns[c])
    ]
    shown = {
        s
        for s, (_, value) in plain.signals.items()
        if not np.array_equal(value, wrong.signals[s][1])
    }
    if reading:
        signal = kind.equation.split(":")[1]
        assert moved == []
        assert signal in shown <= {signal, "motor_position"}
    else:
        assert moved and shown
        for signal in ("engine_speed", "slave_position", "engine_torque"):
            time, value = wrong.signals[signal]
            true = np.interp(time, wrong.truth.time, wrong.truth.columns[signal])
            assert np.median(np.abs(value - true)) < 1e-3
    nothing = drives(kind(0.0))
    for column, values in plain.truth.columns.items():
        assert np.array_equal(values, nothing.truth.columns[column]), column
    for signal, (_, value) in plain.signals.items():
        assert np.array_equal(value, nothing.signals[signal][1]), signal


def test_near_misses_are_enough_and_six_of_them_in_no_list():
    """What is said to be in no list is no error term over that driver."""
    from blind.near_misses import NEAR_MISSES
    from blind.outsiders import OUTSIDERS

    terms = machine_of("dry_clutch").error_terms.values()
    assert len(NEAR_MISSES) >= 12 and not set(NEAR_MISSES) & set(OUTSIDERS)
    unlisted = [kind for kind in NEAR_MISSES.values() if not kind.listed]
    assert len(unlisted) >= 6
    everywhere = {*machine_of("dry_clutch").units, *machine_of("dry_clutch").covariates}
    everywhere |= {*machine_of("dry_clutch").rates, "time", "energy", "temp_disc", "temp_body"}
    everywhere |= {"rest_time", "recent_slip", "engagements", "engine_acceleration"}
    for kind in unlisted:
        if kind.name == "judder":  # what is in no list there is that it is periodic
            continue
        for term in terms:
            if term.equation == kind.equation:
                assert kind.drivers[0] not in (term.covariates or everywhere), kind.name


def _near_misses() -> list[str]:
    files = [BENCHMARKS / "blind" / f"{name}.py" for name in ("unlisted", "near_misses")]
    every = [node for file in files for node in ast.parse(file.read_text()).body]
    classes = [node for node in every if isinstance(node, ast.ClassDef)]
    return [node.name for node in classes if node.name != "NearMiss"]


@pytest.mark.slow
@pytest.mark.parametrize("name", _near_misses())
def test_a_near_miss_acts_where_it_says(drives, plain, name):
    """What has a law changes the truck, what has readings the sensors, and those alone."""
    from blind import near_misses
    from blind.outsiders import Outsider

    kind = next(k for k in near_misses.NEAR_MISSES.values() if k.__name__ == name)
    acts = kind.law is not Outsider.law
    shows = kind.readings is not Outsider.readings
    assert shows == any(e.startswith(("sensor:", "timing:")) for e in (kind.equation,))
    wrong, nothing = drives(kind(kind.largest / 3)), drives(kind(0.0))
    columns = {c: v for c, v in plain.truth.columns.items() if v.dtype.kind == "f"}
    moved = [c for c, v in columns.items() if not np.array_equal(v, wrong.truth.columns[c])]
    assert bool(moved) == acts
    true = {
        signal: np.interp(time, wrong.truth.time, wrong.truth.columns[signal])
        for signal, (time, _) in wrong.signals.items()
        if signal in columns
    }
    off = {s for s, v in true.items() if np.max(np.abs(wrong.signals[s][1] - v)) > 0.02 * np.ptp(v)}
    usual = {
        s
        for s in true
        if np.max(
            np.abs(
                plain.signals[s][1] - np.interp(plain.signals[s][0], plain.truth.time, columns[s])
            )
        )
        > 0.02 * np.ptp(columns[s])
    }
    expected = {kind.equation.split(":")[1]} if shows else set()
    assert off - usual <= expected
    for column, values in columns.items():
        assert np.array_equal(values, nothing.truth.columns[column]), column
    for signal, (_, value) in plain.signals.items():
        assert np.array_equal(value, nothing.signals[signal][1]), signal


@pytest.fixture
def short(monkeypatch):
    """Drives of two minutes."""
    from blind import drives

    monkeypatch.setattr(drives, "SHORTEST", 120.0)
    monkeypatch.setattr(drives, "LONGEST", 130.0)


def test_a_case_is_the_same_every_time(tmp_path, short):
    from blind.cases import HELD_OUT, LOG, VEHICLE, write
    from blind.plan import Case
    from blind.sealed import unseal

    case = Case("effect", "friction_level.change", 4.0, "ar05", 1000)  # none of the suite's
    known = {
        "case": {"part": "effect"},
        "attempt": 0,
        "outsider": None,
        "d_prime": 4.0,
        "effects": {"friction_level": {"change": -0.1}},
    }
    for turn in ("a", "b"):
        write(case, tmp_path / turn, tmp_path / f"{turn}.sealed", known)
    for file in (LOG, HELD_OUT, VEHICLE):
        a, b = ((tmp_path / turn / file).read_bytes() for turn in ("a", "b"))
        assert a == b and b"friction_level" not in a
    assert unseal(tmp_path / "a.sealed") == known
    vehicle = clutchest.load_vehicle(tmp_path / "a" / VEHICLE)
    assert {s.noise_ar for s in vehicle.signals.values()} == {0.5} and not vehicle.effects
    logs = [clutchest.read_log(tmp_path / "a" / file, vehicle) for file in (LOG, HELD_OUT)]
    assert all(119 < log.end < 131 for log in logs)
    assert not np.array_equal(
        logs[0]["engine_speed"].value[:1000], logs[1]["engine_speed"].value[:1000]
    )


def test_noise_is_as_the_vehicle_file_states(short):
    """In every kind: standard deviation over readings less the exact ones, and correlation."""
    from blind.drives import NOISES, Drive

    for kind, noise in NOISES.items():
        drive = Drive(5, kind)
        shown, exact = drive.signals(), drive.signals(noiseless=True)
        for name in ("engine_torque", "engine_speed", "input_shaft_speed"):
            stated = drive.vehicle.signals[name]
            error = shown[name].value - exact[name].value
            kept = error[np.abs(error) < 5 * stated.noise]
            assert np.std(kept) == pytest.approx(stated.noise, rel=0.05), (kind, name)
            ar = np.mean(kept[1:] * kept[:-1]) / np.var(kept)
            assert stated.noise_ar == noise.ar == pytest.approx(ar, abs=0.06), (kind, name)
            far = 1 - len(kept) / len(error)
            assert far == pytest.approx(noise.outliers, abs=0.003), (kind, name)
        steps = np.unique(np.round(shown["engine_torque"].value, 6))
        assert (np.diff(steps).min() > 20.0) == noise.coarse


@pytest.mark.slow
def test_scores_are_as_far_from_nought_as_the_oracle_says():
    """Of causes that act at once and of causes that act by way of temperatures: in drives with
    noise, the score of what is hidden scatters by one standard deviation around its d′."""
    from dataclasses import replace

    from blind.drives import Drive
    from blind.oracle import Oracle

    from clutchest.discovery import search
    from clutchest.inference.problem import Problem

    gains = (
        "expansion_body.change",
        "friction_temperature.slope",
        "heat_capacity_body.change",
        "torque_curve.change",
        "wear.rate",
        "centrifugal.slope",
    )

    class Steady(Drive):
        """Of a truck without discrepancies: the oracle reckons with all the wander that is stated,
        a score with what the log shows of it."""

        @property
        def vehicle(self):
            return replace(super().vehicle, estimation={}, healthy=(), smooth_errors=())

    effects, off = machine_of("dry_clutch").effects, []
    for seed, gain in enumerate(gains, 20):
        drive, (name, key) = Steady(seed, ("white", "ar05", "quantised")[seed % 3]), gain.split(".")
        oracle = Oracle(drive)
        number = next(n for n in effects[name].gains if n.key == key)
        size = min(5.0 / oracle.per_largest(gain), 1.0) * number.upper
        hidden = {name: {key: size}}
        begun = search.begin(
            Problem.of(drive.signals(hidden), drive.vehicle, tuple(effects.values()))
        )
        own = [i for i, candidate in enumerate(begun.candidates) if candidate.name == name]
        promised = oracle.distance(oracle.twin(hidden))
        off.append(begun.null_scores.z[own].max() - promised)
    assert np.sum(np.square(off)) < chi2.isf(0.001, len(off)), off


@pytest.mark.slow
def test_what_an_extension_gains_is_what_it_explains(tmp_path):
    """The truth gains all that can be gained, half of it three quarters, its opposite three times
    as much less, and no extension nothing."""
    from dataclasses import replace

    from blind.drives import Drive
    from blind.gain import HeldOut, on_held_out
    from blind.oracle import Oracle

    from clutchest.vehicle import dump_vehicle

    class Exact(HeldOut):
        """Of a truck without discrepancies: what is gained is measured as if there were none."""

        @property
        def vehicle(self):
            return replace(super().vehicle, estimation={}, healthy=(), smooth_errors=())

    drive = Drive(2, "ar05")
    size = 3.0 / Oracle(Exact(2, "ar05")).per_largest("friction_level.change") * 0.5
    answer = {"effects": {"friction_level": {"change": size}}, "outsider": None}
    gains = []
    for share in (1.0, 0.5, -1.0, 0.0):
        effects = {"friction_level": {"change": share * size}} if share else {}
        path = tmp_path / "extended.toml"
        dump_vehicle(replace(drive.vehicle, effects=effects), path)
        found = on_held_out(drive, answer, path)
        assert found["possible"] == pytest.approx(4.5, rel=0.15)
        gains.append(found["gained"] / found["possible"])
    assert gains[0] == pytest.approx(1.0, abs=0.03)
    assert gains[1] == pytest.approx(0.75, abs=0.06)
    assert -4.0 < gains[2] < -2.0
    assert gains[3] == 0.0


# --- the table -----------------------------------------------------------------------------------


def record(part: str, verdict: str, **more: Any) -> dict[str, Any]:
    plain = {
        "part": part,
        "verdict": verdict,
        "cause": "wear.rate",
        "noise": "white",
        "reached": 12.0,
        "one_sided": False,
        "nearest": 9.0,
        "alike": [],
        "hidden_unexcited": False,
        "truth": ["wear"],
        "causes": ["wear"] if verdict == "named" else [],
        "equation": "torque",
        "drivers": ["energy", "time"],
        "expected_where": None,
        "unexcited": [],
        "followed_up": None,
        "covered": {},
        "seconds": 10.0,
        "MiB": 300.0,
    }
    return {**plain, **more}


def row(records: list[dict[str, Any]], what: str) -> Any:
    from blind.table import rows

    return next(found for found in rows(records) if found.what.startswith(what))


def test_false_findings_have_exact_intervals():
    some = [record("null", "none")] * 990 + [record("null", "unknown")] * 10
    found = row(some, "false findings, white")
    assert (found.count, found.value, found.passed) == (1000, 0.01, True)
    assert binom.sf(9, 1000, found.low) == pytest.approx(0.005)  # Clopper–Pearson, 99 %
    assert binom.cdf(10, 1000, found.high) == pytest.approx(0.005)
    assert not row(some + [record("null", "named")] * 15, "false findings, white").passed
    assert not row([record("null", "none")] * 1000, "false findings, white").passed
    assert row(some, "false findings, ar09").passed is None


def test_a_size_found_in_half_of_the_runs_is_recovered():
    """Effects found along known logistic curves: the ratio to 2.576 (2.326 where one-sided)."""
    random = np.random.default_rng(1)
    records = []
    for cause, one_sided, half in (("a.x", False, 3.5), ("b.x", True, 3.0), ("c.x", False, 5.0)):
        for d in (2.0, 3.0, 4.0, 5.0, 6.0, 12.0) * 200:
            hit = random.random() < 1 / (1 + np.exp(-6.0 * np.log(d / half)))
            records.append(
                record(
                    "effect",
                    "named" if hit else "none",
                    cause=cause,
                    reached=d,
                    one_sided=one_sided,
                )
            )
    assert row(records, "detection: a.x").value == pytest.approx(3.5 / 2.576, rel=0.05)
    assert row(records, "detection: b.x").value == pytest.approx(3.0 / 2.326, rel=0.05)
    assert row(records, "detection: median").value == pytest.approx(3.5 / 2.576, rel=0.05)
    assert row(records, "detection: median").passed
    worst = row(records, "detection: worst ratio, c.x")
    assert worst.low < 5.0 / 2.576 < worst.high and worst.high - worst.low < 0.3
    assert worst.passed


def test_names_sets_and_causes_from_outside_are_counted():
    named = [record("effect", "named")] * 19 + [record("effect", "ambiguous", causes=["wear"])]
    assert row(named, "effects, d′ ≥ 10.8").value == 0.95
    assert row(named, "effects, d′ ≥ 10.8").passed
    assert not row(
        [*named, record("effect", "named", causes=["play"])], "effects, d′ ≥ 10.8"
    ).passed
    close = [record("effect", "named", nearest=3.0, causes=["play"])] * 50
    assert row(named + close, "effects, d′ ≥ 10.8").count == 20, "rivals too near to be told apart"
    small = [record("effect", "none", reached=6.0)] * 50
    assert row(named + small, "effects, d′ ≥ 10.8").count == 20

    alike = [
        record(
            "effect",
            "ambiguous",
            nearest=1.0,
            alike=["play"],
            causes=["play", "wear"],
            followed_up={"right": True},
        )
    ] * 3
    alike += [record("effect", "ambiguous", nearest=1.0, alike=["play"], causes=["play", "drag"])]
    assert row(alike, "ambiguous: truth inside").value == 0.75
    assert row(alike, "ambiguous: mean size").value == 1.0
    assert row(alike, "ambiguous: right after").count == 3

    where = {"equation": "torque", "drivers": ["energy"]}
    outside = [record("outsider", "unknown", expected_where=where)] * 9
    outside += [
        record(
            "outsider",
            "named",
            expected_where=where,
            equation="disc_heat",
            drivers=["a", "b", "energy"],
        )
    ]
    assert row(outside, "outsiders, d′ ≥ 8 left: unknown").value == 0.9
    assert row(outside, "outsiders, d′ ≥ 8 left: equation").value == 0.9
    assert row(outside, "outsiders, d′ ≥ 8 left: driver").value == 0.9
    assert (
        row(
            [record("outsider", "unknown", reached=5.0, expected_where=where)],
            "outsiders, d′ ≥ 8 left: unknown",
        ).count
        == 0
    )
    both = [
        record("two", "named", truth=["wear", "drag"], causes=["drag", "wear"]),
        record("two", "named", truth=["wear", "drag"], causes=["wear"]),
    ]
    assert row(both, "pairs, d′ ≥ 8").value == 0.5
    failed = [record("effect", "failed"), record("null", "failed")]
    assert row(failed, "discoveries that failed").value == 1.0
    assert row(failed, "false findings, white").value == 1.0
    assert row(failed, "effects, d′ ≥ 10.8").value == 0.0


def test_gain_and_coverage_are_pooled():
    records = [
        record(
            "effect",
            "named",
            gained=90.0,
            possible=100.0,
            held_out_nll=-1e5,
            covered={"wear.rate": True},
        ),
        record(
            "effect",
            "named",
            gained=9.0,
            possible=10.0,
            held_out_nll=-1e5,
            covered={"wear.rate": False},
        ),
        record(
            "outsider",
            "unknown",
            gained=50.0,
            possible=100.0,
            held_out_nll=-1e5,
            expected_where={"equation": "torque", "drivers": []},
        ),
        record("null", "named", gained=-300.0, possible=0.0, held_out_nll=-1e5),
    ]
    assert row(records, "gain: named").value == pytest.approx(0.9)
    assert row(records, "gain: named").passed
    assert row(records, "gain: unknown").passed is False
    assert row(records, "gain: nulls").value == pytest.approx(-0.003)
    assert row(records, "gain: nulls").passed is False
    assert row(records, "±2 σ coverage").value == 0.5
    assert row(records, "±2 σ: wear.rate").count == 2
    assert row(records[2:], "gain: named").passed is None


def test_what_a_discovery_takes_is_its_own(tmp_path, monkeypatch):
    """Memory and time of the discovery alone; whatever goes wrong is a verdict of its own."""
    from blind import score

    ballast = np.ones(40_000_000)  # 320 MB
    found = score.discovered([tmp_path / "none.parquet"], tmp_path, tmp_path / "out")
    assert found["verdict"] == "failed" and found["why"]
    assert 0.05 < found["seconds"] < 60 and 20 < found["MiB"] < 250 < ballast.nbytes / 2**20
    monkeypatch.setattr(score, "LONGEST", 0.01)
    slow = score.discovered([tmp_path / "none.parquet"], tmp_path, tmp_path / "out")
    assert (slow["verdict"], slow["why"]) == ("failed", "too slow")


def test_an_hour_counts_for_its_cost_alone():
    records = [
        {"part": "hour", "name": "hour", "verdict": "none", "seconds": 31.0, "MiB": 500.0},
        {
            "part": "hour",
            "name": "hour with a cause",
            "verdict": "named",
            "seconds": 9.0,
            "MiB": 2e3,
        },
    ]
    assert row(records, "a log of one hour: s").passed is False
    assert row(records, "a log of one hour: MiB").passed is True
    assert row(records, "a log of one hour with a cause: s").value == 9.0
    assert row(records, "a log of one hour with a cause: s").passed is None
    assert row(records, "false findings, white").count == 0


def test_an_answer_and_a_finding_are_compared():
    from blind.score import judged

    answer = {
        "case": {"cause": "wear.rate", "d_prime": 12.0},
        "effects": {"wear": {"rate": 0.1}},
        "outsider": None,
        "d_prime": 11.5,
        "one_sided": True,
        "excited": {"wear.rate": 40.0},
        "rivals": {"transmission_heat_path": 1.5, "play": 8.0},
    }
    found = {
        "verdict": "named",
        "seconds": 1.0,
        "MiB": 2.0,
        "unexcited": [],
        "causes": [{"effect": "wear", "parameters": {"rate": {"value": 0.13, "std": 0.014}}}],
        "where": {"equation": "zero_position", "drivers": ["energy"]},
    }
    told = judged(answer, found)
    assert told["truth"] == told["causes"] == ["wear"]
    assert (told["nearest"], told["alike"]) == (1.5, ["transmission_heat_path"])
    assert told["sizes"] == {"wear.rate": (0.1, 0.13, 0.014)}
    assert told["covered"] == {"wear.rate": False}, "0.03 off at 0.014"
    assert not told["hidden_unexcited"]
    assert judged({**answer, "excited": {"wear.rate": 1.0}}, found)["hidden_unexcited"]
    nothing = judged(answer, {"verdict": "failed", "why": "no", "seconds": 1.0, "MiB": 2.0})
    assert nothing["causes"] == [] and nothing["covered"] == {}


def test_rivals_see_the_torque_that_is_lacking():
    """Of a truck as its file says nothing lacks; of one whose friction is low, a share of what its
    clutch should transmit."""
    from blind.drives import Drive
    from blind.rivals import lacking, regression

    drive = Drive(1, "white")
    truck = {"nominal": True, "duration": 200.0}
    healthy = clutchest.simulate(drive.vehicle, "launches", 1, **truck)
    _, nothing = lacking(healthy, drive)
    low = {"friction_level": {"change": -0.1}}
    drivers, lacks = lacking(clutchest.simulate(drive.vehicle, "launches", 1, low, **truck), drive)
    assert abs(np.mean(nothing)) < 3.0
    assert np.mean(lacks) > 10.0 * abs(np.mean(nothing))  # the engine is braked less
    assert "engine_torque" in regression(drivers, lacks)[:3]


def test_discover_and_its_rivals_stand_side_by_side():
    from blind.rivals import counted, lines

    plain = {"noise": "white", "verdict": "none", "drivers": None, "reached": 0.0}
    scored = [
        {**plain, "name": "a", "part": "null"},
        {**plain, "name": "b", "part": "effect", "reached": 12.0, "verdict": "named"},
        {
            **plain,
            "name": "c",
            "part": "outsider",
            "reached": 9.0,
            "verdict": "unknown",
            "drivers": ["time", "energy"],
            "expected_where": {"drivers": ["energy"]},
        },
    ]
    found = {
        "a": {"regression": ["time"], "sindy": []},
        "b": {"regression": ["time"], "sindy": []},
        "c": {"regression": ["time", "temp_disc", "energy"], "sindy": ["energy"]},
    }
    head, *told = [line.split() for line in lines(scored, found).splitlines()]
    assert head == ["what", "cases", "discover", "regression", "sindy"]
    rows = [[w for w in line if w.replace(".", "").isdigit()] for line in told if "–" not in line]
    assert rows[0] == ["1", "0.00", "1.00", "0.00"]
    assert rows[1] == ["12", "1", "1.00", "1.00", "0.00"]
    assert rows[2] == ["1", "1.00", "0.00", "1.00"]
    small = {**plain, "name": "d", "part": "effect", "reached": 5.0}
    cases = [r["name"] for part in counted([*scored, small]).values() for r in part]
    assert cases == ["a", "b", "c"]


def test_a_row_is_refuted_where_its_interval_holds_nothing_that_passes():
    from blind.row import share

    def row(hits: int, of: int) -> Any:
        return share("", "≥ 90 %", [True] * hits + [False] * (of - hits), lambda p: p >= 0.9)

    assert row(9, 10).passed and not row(9, 10).refuted
    assert not row(7, 10).passed and not row(7, 10).refuted  # ten cases cannot tell
    assert not row(70, 100).passed and row(70, 100).refuted
    between = share("", "", [True] * 99 + [False], lambda p: 0.94 <= p <= 0.97)
    assert not between.passed and not between.refuted
    assert share("", "", [True] * 400, lambda p: 0.94 <= p <= 0.97).refuted


def test_the_short_run_fails_where_a_case_is_missing(tmp_path, monkeypatch):
    from blind import __main__ as suite

    monkeypatch.setattr(sys, "argv", ["blind", "--ci", "--table", "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as stop:
        suite.main()
    assert stop.value.code == 1


def test_main_lines_count_every_case():
    """However little the drive could show; the filtered ones beside them do not."""
    near = {"equation": "torque", "equations": ["torque", "disc_heat"], "drivers": ["energy"]}
    records = [
        record("effect", "named", reached=2.0),
        record("effect", "ambiguous", reached=2.0, causes=["play", "wear"]),
        record("effect", "none", reached=2.0),
        record("effect", "named", refuted=["wear"]),
        record("two", "named", reached=1.0, truth=["wear", "drag"], causes=["drag", "wear"]),
        record("near-miss", "named", reached=1.0, expected_where=near, refuted=["wear"]),
        record("near-miss", "unknown", reached=1.0, expected_where=near, equation="disc_heat"),
        record("near-miss", "named", expected_where=near, equation="zero_position"),
        *[record("mismatch", "none", cause="wander")] * 30,
        *[record("mismatch", "unknown", cause="driver")] * 10,
    ]
    named = row(records, "all detected effects: named right")
    assert (named.count, named.value) == (3, pytest.approx(1 / 3)), "a refuted form is not right"
    assert row(records, "all detected effects: truth").value == 1.0
    assert row(records, "all pairs").value == 1.0 and row(records, "pairs, d′").count == 0
    assert row(records, "all near misses: unknown").value == pytest.approx(2 / 3)
    assert row(records, "all near misses: equation").value == pytest.approx(2 / 3)
    assert row(records, "near misses, d′ ≥ 8 left: unknown").count == 1
    wander = row(records, "false findings, unlike the model, wander")
    assert (wander.count, wander.value, wander.passed) == (30, 0.0, True)
    assert row(records, "false findings, unlike the model, driver").refuted
    assert row(records, "false findings, unlike the model, pooled").count == 40


def test_the_table_counts_first_runs_and_says_whose(tmp_path):
    from blind.table import rows, runs, show, versions

    def at(hour: int, verdict: str, version: str) -> str:
        stamp = {"at": f"2026-01-01T{hour:02}:00:00+00:00", "version": version, "name": "a"}
        return json.dumps({**record("null", verdict), **stamp}) + "\n"

    (tmp_path / "records-0-of-2.jsonl").write_text(at(5, "none", "bbb"))
    (tmp_path / "records-1-of-2.jsonl").write_text(at(3, "named", "aaa") + at(4, "none", "bbb"))
    first, again = runs(tmp_path)
    assert [r["verdict"] for r in first] == ["named"] and [r["at"][11:13] for r in again] == ["05"]
    assert versions(first) == "one version: aaa (1)"
    assert versions([*first, *again]).startswith("not of one version")
    assert versions([record("null", "none")]).startswith("not of one version"), "who knows"
    text = show(first, again)
    line = next(line for line in text.splitlines() if line.startswith("false findings, white"))
    assert line.split()[-2:] == ["0", "(1)"] and rows(first)[0].value == 1.0
    assert text.index("all pairs") < text.index("of these") < text.index("pairs, d′ ≥ 8")


def test_what_is_found_is_located():
    from blind.score import located, refuted

    where = {"equation": "torque", "drivers": ["slip_speed", "time"]}
    named = {"effect": "friction_slip", "equation": "torque", "parameters": {}, "form": "refuted"}
    found = {"verdict": "named", "causes": [named], "where": where}
    assert refuted(found) == ["friction_slip"] and located(found) == ("torque", where["drivers"])
    for form in ("held", None):
        assert refuted({**found, "causes": [{**named, "form": form}]}) == []
    assert located({"verdict": "none", "causes": [], "where": None}) == (None, None)


def test_no_seed_of_a_test_is_one_of_the_suite_s():
    """Of a case, its other tries, or the drives held out beside it: no number that stands in a test
    is one, no range of such numbers holds one, and no case that a test makes is the suite's."""
    from blind.cases import TRIES
    from blind.drives import OTHER_ROAD
    from blind.plan import full

    cases = full()
    tries = {case.seed + attempt * 2**32 for case in cases for attempt in range(TRIES)}
    seeds = np.array(sorted(tries | {seed + OTHER_ROAD for seed in tries}))
    names = {tuple(map(str, (c.part, c.cause, c.d_prime, c.noise, c.number))) for c in cases}
    tests, met = sorted(Path(__file__).parent.rglob("*.py")), 0
    assert len(tests) > 100
    for path in tests:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for first, last in _numbers(node):
                found = seeds[np.searchsorted(seeds, first) :][:1]
                assert not (found <= last).any(), f"{path.name}, line {node.lineno}: {found}"
                met += 1
            if made := _case(node):
                assert made not in names, f"{path.name}, line {node.lineno}: {made}"
    assert met > 1000


def _numbers(node: ast.AST) -> list[tuple[int, int]]:
    """The whole numbers that a node stands for, first and last of each range."""
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return [(node.value, node.value)]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range":
        given = [a.value for a in node.args if isinstance(a, ast.Constant)]
        if len(given) == len(node.args):
            return [(0, given[0] - 1) if len(given) == 1 else (given[0], given[1] - 1)]
    return []


def _case(node: ast.AST) -> tuple[str, ...] | None:
    """What a case is made of, where a node makes one by plain values."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Case":
        given = [a.value for a in node.args if isinstance(a, ast.Constant)]
        return tuple(map(str, given)) if len(given) == len(node.args) else None
    return None


def test_m_utl_by_hand():
    """Of four parts: a sound one replaced beside the faulty one costs 1·3/(4·2), the faulty one
    left alone 1·5/(4·2), the wrong one named 1·2/(4·2) + 1·4/(4·2)."""
    from blind.utility import of_one, of_record, of_sets

    a, b, none = frozenset("a"), frozenset("b"), frozenset()
    assert of_one(a, a, 4) == 1.0
    assert of_one(a | b, a, 4) == pytest.approx(1 - 3 / 8)
    assert of_one(none, a, 4) == pytest.approx(1 - 5 / 8)
    assert of_one(b, a, 4) == pytest.approx(1 - 2 / 8 - 4 / 8)
    assert of_one(a, a | b, 4) == pytest.approx(1 - 1 * 4 / (4 * 2))
    assert of_sets({a, b}, {a, b}, 4) == 1.0
    assert of_sets({a, b}, {a}, 4) == pytest.approx((1 + 1 / 4) / 2)
    assert of_sets({a}, {a, b}, 4) == 1.0, "the mean over the true set is as good for each of it"
    alike = {"truth": ["a"], "alike": ["b"]}
    assert of_record({**alike, "verdict": "ambiguous", "causes": ["a", "b"]}, 4) == 1.0
    assert of_record({**alike, "verdict": "named", "causes": ["b"]}, 4) == 1.0
    mean = (1 + 1 / 4 + 1 / 4 + 1) / 4  # of the true set by itself
    both = (1 - 3 / 8) / mean
    assert of_record({**alike, "verdict": "named", "causes": ["a", "b"]}, 4) == pytest.approx(both)
    nothing = (1 - 5 / 8) / mean
    assert of_record({**alike, "verdict": "none", "causes": []}, 4) == pytest.approx(nothing)


def test_the_utility_of_ambiguous_sets_is_a_line():
    from blind.plan import gains
    from blind.utility import of_record

    alike = {"nearest": 1.0, "alike": ["drag"], "truth": ["wear"]}
    good = record("effect", "ambiguous", **alike, causes=["wear", "drag"])
    wrong = record("effect", "ambiguous", **alike, causes=["wear", "play"])
    found = row([good] * 9 + [wrong], "ambiguous: m_utl")
    value = of_record(wrong, len({gain.split(".")[0] for gain in gains()}))
    assert found.count == 10 and found.value == pytest.approx((9 + value) / 10)
    assert found.low < found.value < found.high and found.passed == (found.value >= 0.95)


@pytest.mark.slow
@pytest.mark.parametrize(("group", "number"), [("flywheel", 118), ("hot-start", 102)])
def test_slip_that_is_held_says_nothing_of_lateness(group, number):
    """Speeds that hardly change, with outliers: their noise changes, and once seemed 16 ms late."""
    from blind.plan import Case

    from clutchest.discovery.speed_agreement import disagreement

    drive = Case("mismatch", group, 0.0, "outliers", number).drive()
    assert disagreement(drive.signals(), drive.vehicle) is None
