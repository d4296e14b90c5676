"""What `simulate` is asked for: disturbances, another drive of one truck, effects given twice."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from scipy.stats import chi2

import clutchest
from clutchest import cli
from clutchest.errors import ClutchestError
from clutchest.generator import EFFECTS, Disturbances
from clutchest.generator.effects import LARGEST
from clutchest.generator.surroundings import surroundings
from clutchest.simulated import simulate, simulate_frames, write_simulation

WANDERING = {
    "torque_bias_walk": 2.0,
    "torque_bias_std": 8.0,
    "friction_walk": 0.005,
    "friction_std": 0.05,
}


@pytest.fixture(scope="module")
def truck() -> clutchest.Vehicle:
    return clutchest.load_vehicle("truck")


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """`simulate` a short drive, with these arguments more: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> tuple[int, str, str]:
        drive = "simulate --vehicle truck --scenario closed --seed 2 --duration 2 -o x.log"
        monkeypatch.setattr(sys, "argv", ["clutchest", *drive.split(), *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return (end.value.code or 0, *capsys.readouterr())

    return call


@pytest.mark.parametrize(
    ("column", "start", "walk"),
    [
        ("friction", "friction_std", "friction_walk"),
        ("torque_bias", "torque_bias_std", "torque_bias_walk"),
    ],
)
def test_variance_over_seeds_grows_with_time(column, start, walk):
    seeds, times = 400, (0, 400, 3600)  # rows of 0.1 s
    drawn = [
        getattr(surroundings(seed, 400.0, Disturbances.of(WANDERING)), column)[list(times)]
        for seed in range(seeds)
    ]
    variance = np.var(drawn, axis=0, ddof=1)
    expected = WANDERING[start] ** 2 + WANDERING[walk] ** 2 * 0.1 * np.array(times)
    low, high = chi2.ppf([5e-4, 1 - 5e-4], seeds - 1) / (seeds - 1)
    assert np.all(variance > low * expected) and np.all(variance < high * expected)


def test_truth_follows_the_disturbances_and_the_effects(truck):
    effects = {
        "friction_level": {"change": -0.2},
        "torque_bias": {"bias": 40.0},
        "wear": {"amount": 0.1, "rate": 0.5},
    }
    drive = simulate(
        truck, "launches", 3, effects, duration=60.0, nominal=True, disturbances=WANDERING
    )
    plain = simulate(truck, "launches", 3, duration=60.0, nominal=True)
    around = surroundings(3, 60.0, Disturbances.of(WANDERING))
    truth, late = drive.truth, 60.0 - drive.truth.time[-1]
    input_noise_directions = [
        np.interp(truth.time + late, around.time, column)
        for column in (around.friction, around.torque_bias)
    ]
    c = truth.columns
    assert np.ptp(c["friction"]) > 0.01 and np.ptp(c["torque_bias"]) > 2
    np.testing.assert_allclose(c["friction"], 0.8 * input_noise_directions[0], atol=2e-4)
    np.testing.assert_allclose(c["torque_bias"], 40.0 + input_noise_directions[1], atol=0.2)
    np.testing.assert_allclose(
        c["zero_position"], 38.4 - 0.1 - 0.5e-6 * c["slip_energy"], atol=1e-9
    )
    # the bias is in the report, the friction in the torque itself
    torque = drive["engine_torque"]
    told = torque.value - np.interp(torque.time, truth.time, c["engine_torque"])
    meant = np.interp(torque.time, truth.time, c["torque_bias"])
    assert np.mean(told - meant) == pytest.approx(0.0, abs=8.0)  # coloured noise of 15 Nm
    assert np.all(plain.truth.columns["friction"] == 1)
    assert np.all(plain.truth.columns["torque_bias"] == 0)


def test_another_drive_of_the_same_truck(truck, tmp_path):
    import pyarrow.parquet as pq

    def about(seed: int, **options: int) -> dict[str, str]:
        path = write_simulation(
            tmp_path / "x.parquet", truck, "closed", seed, duration=2.0, **options
        )
        metadata = pq.read_schema(path).metadata
        return {key.decode(): value.decode() for key, value in metadata.items()}

    own, other, foreign = about(5), about(6, truck_seed=5), about(6)
    assert own["parameters"] == other["parameters"] != foreign["parameters"]
    assert (other["seed"], other["truck_seed"], own["truck_seed"]) == ("6", "5", "5")
    drives = [
        simulate_frames(truck, "closed", seed, duration=2.0, truck_seed=5) for seed in (5, 6)
    ] + [simulate_frames(truck, "closed", 6, duration=2.0)]
    (own_frames, own_truth), (other_frames, other_truth), (foreign_frames, foreign_truth) = drives
    zero = [t.columns["zero_position"][0] for t in (own_truth, other_truth, foreign_truth)]
    assert zero[0] == zero[1] != zero[2]
    speed = [t.columns["engine_torque"][-1] for t in (own_truth, other_truth)]
    assert speed[0] != speed[1]
    assert len({f.t_ns[0] for f in (own_frames, other_frames, foreign_frames)}) == 3
    same, _ = simulate_frames(truck, "closed", 5, duration=2.0)
    assert np.array_equal(same.data, own_frames.data) and np.array_equal(same.t_ns, own_frames.t_ns)


def test_metadata_tell_the_disturbances(run, tmp_path):
    import pyarrow.parquet as pq

    code, out, err = run(
        "--disturb",
        "torque_bias_walk=0.5",
        "--disturb",
        "friction_std=0.05",
        "--truck-seed",
        7,
        "--json",
    )
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["disturbances"] == {"torque_bias_walk": 0.5, "friction_std": 0.05}
    assert told["truck_seed"] == 7
    metadata = pq.read_schema(tmp_path / "x.log.truth.parquet").metadata
    assert json.loads(metadata[b"disturbances"]) == {
        "torque_bias_walk": 0.5,
        "torque_bias_std": 0.0,
        "friction_walk": 0.0,
        "friction_std": 0.05,
    }
    assert json.loads(metadata[b"truck_seed"]) == 7


def test_parts_of_one_effect_join(run):
    code, out, _ = run("--effect", "wear:amount=0.5", "--effect", "wear:rate=0.02", "--json")
    assert code == 0
    assert json.loads(out)["effects"] == {"wear": {"amount": 0.5, "rate": 0.02}}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--disturb", "friction_wlak=0.1"), "did you mean 'friction_walk'"),
        (("--disturb", "friction_walk=-0.1"), "expected 0 to 0.02"),
        (("--disturb", "friction_walk=nan"), "expected 0 to 0.02"),
        (("--disturb", "torque_bias_std=inf"), "expected 0 to 500"),
        (("--effect", "torque_delay:delay=1e9"), "magnitude of at most 2"),
        (("--effect", "friction_level:change=1e3"), "magnitude of at most 4"),
        (("--effect", "position_delay:delay=2"), "less than the drive's 2 s"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(run, tmp_path, arguments, says):
    code, out, err = run(*arguments)
    assert (code, out, err.count("\n")) == (1, "", 1) and says in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("--effect", "wear:amount=0.5", "--effect", "wear:amount=0.6"),
        ("--effect", "wear:amount=0.5,amount=0.6"),
        ("--disturb", "friction_std=0.1", "--disturb", "friction_std=0.1"),
        ("--disturb", "friction_std"),
        ("--effect", "wear:amount=much"),
        ("--truck-seed", "-1"),
    ],
)
def test_wrong_usage_is_2(run, tmp_path, arguments):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "") and "Error:" in err
    assert list(tmp_path.iterdir()) == []


def test_every_parameter_has_a_largest_magnitude():
    for name, effect in EFFECTS.items():
        for key, value in effect.parameters.items():
            assert abs(value) < LARGEST[key], (name, key)


def test_a_seed_below_zero_is_told(truck):
    with pytest.raises(ClutchestError, match="truck_seed -1: expected a whole number, 0 or more"):
        simulate(truck, "closed", 1, duration=1.0, truck_seed=-1)
