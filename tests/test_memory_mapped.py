import os
import sys
from pathlib import Path

import numpy as np
import pytest

import clutchest
from clutchest import memory_mapped
from clutchest.estimate import replay
from clutchest.estimate.drive_setup import DriveSetup, warnings_of
from clutchest.models import machine_of
from clutchest.signals import Signal, Signals

linux = pytest.mark.skipif(sys.platform != "linux", reason="memory is told by /proc")


@pytest.fixture
def long_arrays(monkeypatch: pytest.MonkeyPatch):
    """Every array counts as a long one, and no portion holds more than a few seconds."""
    monkeypatch.setattr(memory_mapped, "LEAST", 1)
    monkeypatch.setattr(memory_mapped, "HELD", 0)
    monkeypatch.setattr(memory_mapped, "PORTION", 997)


@pytest.fixture
def nothing_held(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(memory_mapped, "HELD", 0)


def resident_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") / 2**20


@pytest.mark.parametrize("kind", [np.float64, np.int64, np.uint32, np.uint8, np.bool_])
@pytest.mark.parametrize("shape", [(300_000,), (0,), (70_000, 3)])
def test_one_behind_another(nothing_held, kind, shape):
    rng = np.random.default_rng(0)
    parts = [rng.integers(0, 2**20, shape).astype(kind) for _ in range(3)]
    whole = memory_mapped.concatenated(parts)
    memory_mapped.release_memory()
    np.testing.assert_array_equal(whole, np.concatenate(parts))
    assert whole.dtype == kind


def test_so_much_stays_in_memory_until_nobody_needs_it(monkeypatch):
    monkeypatch.setattr(memory_mapped, "_held", {})
    monkeypatch.setattr(memory_mapped, "HELD", 3 << 20)
    first = memory_mapped.empty((1 << 18,), np.float64)  # 2 MiB
    assert memory_mapped._held and isinstance(
        memory_mapped.empty((1 << 18,), np.float64).base, np.ndarray
    )
    del first
    assert not memory_mapped._held and memory_mapped.empty((1 << 18,), np.float64).base is None


@linux
def test_what_is_let_go_takes_no_memory_and_comes_back(nothing_held):
    values = np.arange(8 << 20, dtype=np.float64)
    whole = memory_mapped.mapped_to_disk(values)
    before = resident_mib()
    assert whole.sum() == values.sum()
    assert resident_mib() > before + 32
    memory_mapped.release_memory()
    assert resident_mib() < before + 8
    np.testing.assert_array_equal(whole[::4096], values[::4096])


def test_a_full_disk_leaves_arrays_in_memory(nothing_held, monkeypatch):
    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(memory_mapped, "_room", [])
    monkeypatch.setattr(os, "posix_fallocate", full, raising=False)
    values = np.arange(1 << 17, dtype=np.float64)
    np.testing.assert_array_equal(memory_mapped.mapped_to_disk(values), values)
    assert not memory_mapped._room


def test_a_drive_in_files_is_the_drive_in_memory(request, monkeypatch, tmp_path):
    monkeypatch.setattr(replay, "STRETCH", 40.0)
    runs = []
    for _ in range(2):
        run = clutchest.replay(clutchest.read_log("demo", "truck"), "truck")
        clutchest.write_run(run, tmp_path)
        runs.append(run)
        request.getfixturevalue("long_arrays")
        monkeypatch.setattr(replay, "TOGETHER", 2)
    there, here = (run.tracks[0] for run in runs)
    for name, state in there.states.items():
        np.testing.assert_array_equal(state.value, here.states[name].value)
        np.testing.assert_array_equal(state.std, here.states[name].std)
    for column in ("time", "sensor", "innovation", "std"):
        np.testing.assert_array_equal(
            getattr(there.innovations, column), getattr(here.innovations, column)
        )
    for name in there.innovations.names:
        for a, b in zip(there.innovations.of(name), here.innovations.of(name), strict=True):
            np.testing.assert_array_equal(a, b)
    assert runs[0].summary["sensors"].keys() == runs[1].summary["sensors"].keys()
    for name, told in runs[0].summary["sensors"].items():
        assert told == pytest.approx(runs[1].summary["sensors"][name], rel=1e-12)
    same = set(runs[0].summary) - {"sensors", "log_likelihood"}
    assert {k: runs[0].summary[k] for k in same} == {k: runs[1].summary[k] for k in same}
    assert there.log_likelihood == pytest.approx(here.log_likelihood, rel=1e-12)


def test_spikes_and_gaps_are_the_same_in_portions(request):
    """Spikes on the first, the last and both sides of a border of portions; gaps likewise."""
    truck = clutchest.load_vehicle("truck")
    rng = np.random.default_rng(1)
    time = np.arange(5000) / 100
    time[3 * 997 - 1 :] += 3.0
    time[4000:] += 2.0
    speed = 100 + 0.01 * rng.standard_normal(5000)
    speed[[1, 995, 996, 997, 998, 1993, 1994, 2500, 2990, 2991, 4998]] += 300.0
    speed[[0, 4999]] += 300.0  # nobody can say of these
    why = np.zeros(5000, np.uint8)
    why[990:1010:3] = 1
    torque = Signal.of("engine_torque", "Nm", np.arange(0.0, 50.0, 0.01), np.full(5000, 50.0))
    shaft = Signal.of("input_shaft_speed", "rad/s", time, speed, why)
    engine = Signal.of("engine_speed", "rad/s", time, np.full(5000, 100.0))
    signals = Signals(
        {"engine_speed": engine, "input_shaft_speed": shaft, "engine_torque": torque}, end=80.0
    )
    setting = DriveSetup(truck, machine_of(truck.model).equations(signals), 10.0, {})
    whole = warnings_of(signals, setting)
    request.getfixturevalue("long_arrays")
    assert warnings_of(signals, setting) == whole
    assert any("outlier" in text for text in whole)
    assert any(", the longest" in text for text in whole)
