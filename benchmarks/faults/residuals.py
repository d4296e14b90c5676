"""Simulated residuals: false-alarm rates of the monitors, and detection delays of faults.

Information per block is that of whole recorded drives in random order; the monitors' own thresholds
are computed with shorter stretches and other random numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from clutchest.diagnosis.drive_diagnosis import effects_for
from clutchest.diagnosis.fault_tests import LEAST
from clutchest.diagnosis.sequential import peaks
from clutchest.diagnosis.thresholds import (
    WINDOW,
    Autoregression,
    cusum_path,
    from_path,
    glr_path,
    threshold,
)
from clutchest.models.fault import ModelFault
from clutchest.models.machine import Machine

HOURS_PER_DRIVE = 0.5
CONSECUTIVE = 3  # of the fixed threshold
FRACTIONS = (0.5, 1.0, 2.0)  # of the smallest size that matters
HEALTHY = 200  # blocks before the fault
PER_1000H = 1.0

Path_ = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Record:
    """Residuals of a whole drive of so many ``hours``, and the ``information`` about every fault,
    of each block (blocks, faults)."""

    hours: float
    z: np.ndarray
    information: np.ndarray


def loaded(folder: Path) -> list[Record]:
    """The records of whole drives."""
    every = (np.load(path) for path in sorted(folder.glob("*.npz")))
    return [Record(HOURS_PER_DRIVE, of["z"], of["information"]) for of in every]


def joined(records: Sequence[Record], k: int, blocks: int, rng: np.random.Generator) -> np.ndarray:
    """Information about fault ``k`` in so many blocks of whole drives in random order."""
    pieces, count = [], 0
    while count < blocks:
        piece = records[rng.integers(len(records))].information[:, k].astype(float)
        pieces.append(piece)
        count += len(piece)
    return np.concatenate(pieces)[:blocks]


def measured(records: Sequence[Record], k: int) -> dict[str, float]:
    """Level, autocorrelation and tails of the residuals of whole simulated drives."""
    z = [r.z[:, k][r.information[:, k] > 0].astype(float) for r in records]
    every = np.concatenate(z)
    products = np.concatenate([x[1:] * x[:-1] for x in z])
    return {
        "blocks": len(every),
        "level": float(every.std()),
        "autocorrelation": float(products.mean() / every.var()) if len(every) else 0.0,
        "kurtosis": float(np.mean(every**4) / np.mean(every**2) ** 2) if len(every) else 0.0,
        "largest": float(np.abs(every).max()) if len(every) else 0.0,
    }


@dataclass(frozen=True)
class TestSetup:
    """What the tests of one fault have in common: blocks ``per_hour``, false alarms ``per_block``,
    the measured ``information`` in each block, and the smallest ``size`` that matters, in units."""

    per_hour: float
    per_block: float
    information: np.ndarray
    size: float
    one_sided: bool

    @classmethod
    def of(cls, records: Sequence[Record], fault: ModelFault, k: int, unit: float) -> TestSetup:
        """For the ``k``-th fault in the records of whole drives."""
        per_hour = sum(len(r.z) for r in records) / sum(r.hours for r in records)
        information = np.concatenate([r.information[:, k] for r in records]).astype(float)
        return cls(
            per_hour,
            PER_1000H / 1000.0 / per_hour,
            information,
            fault.size / unit,
            fault.gain.one_sided,
        )

    @property
    def low(self) -> float:
        """The smallest size of the GLR."""
        return LEAST * self.size


def rates(
    records: Sequence[Record],
    fault: ModelFault,
    k: int,
    unit: float,
    hours: float,
    seed: int,
) -> dict[str, Any]:
    """A monitor's thresholds, and how often a healthy truck exceeds them in so many simulated
    hours."""
    rng, of = np.random.default_rng(seed), TestSetup.of(records, fault, k, unit)
    tests: dict[str, Path_] = {
        "glr": lambda s, i: glr_path(s, i, of.low, 1.0, of.one_sided)[0],
        "cusum": lambda s, i: cusum_path(s, i, of.size, of.one_sided)[0],
    }
    blocks = int(hours * of.per_hour)
    information = joined(records, k, blocks, rng)
    score = np.sqrt(information) * rng.standard_normal(blocks)
    enabled = float(np.mean(information > 1e-6))
    results: dict[str, Any] = {"drawn_hours": hours, "enabled_share": enabled}
    for name, test in tests.items():
        h = threshold(test, of.information, Autoregression(), of.per_block)
        count = len(peaks(test(score, information), h, WINDOW))
        expected = of.per_block * blocks
        results[name] = {
            "threshold": h,
            "alarms": count,
            "expected": expected,
            "per_1000_clock_hours": 1000.0 * count / hours,
            "per_1000_enabled_hours": 1000.0 * count / max(hours * enabled, 1e-9),
        }
    plain = _plain_threshold(information, rng, of.per_block)
    results["plain"] = {"threshold": plain, "consecutive": CONSECUTIVE}
    return results


def _plain_threshold(information: np.ndarray, rng: np.random.Generator, per_block: float) -> float:
    """The fixed threshold that three consecutive blocks exceed at the same rate: p³ per block,
    where p is the probability of one."""
    from scipy.stats import norm

    enabled = float(np.mean(information > 1e-6))
    return float(norm.isf((per_block / max(enabled, 1e-9)) ** (1.0 / CONSECUTIVE) / 2.0))


def delays(
    records: Sequence[Record],
    fault: ModelFault,
    k: int,
    unit: float,
    thresholds: dict[str, Any],
    trials: int,
    seed: int,
) -> list[dict[str, float]]:
    """Mean time to detection, h, of faults of several sizes: by the GLR that does not know the
    size, Page's test that does, the fixed threshold, and an oracle.

    The oracle is Page's test with the true size and sign, its threshold from simulations of its own
    with whole drives' information at the monitors' false-alarm rate.
    """
    rng, of = np.random.default_rng(seed), TestSetup.of(records, fault, k, unit)
    rows, glr_at, plain_at = [], thresholds["glr"]["threshold"], thresholds["plain"]["threshold"]
    for fraction in FRACTIONS:
        b = min(fraction * of.size, 1.0)
        long = joined(records, k, 3_000_000, rng)
        healthy = np.sqrt(long) * rng.standard_normal(len(long))
        oracle = from_path(cusum_path(healthy, long, b, True)[0], of.per_block)
        known = threshold(
            lambda s, i, b=b: cusum_path(s, i, b, of.one_sided)[0],
            of.information,
            Autoregression(),
            of.per_block,
        )
        taken: dict[str, list[float]] = {"glr": [], "cusum": [], "plain": [], "oracle": []}
        horizon = 4000
        for _ in range(trials):
            information = joined(records, k, HEALTHY + horizon, rng)
            score = np.sqrt(information) * rng.standard_normal(len(information))
            score[HEALTHY:] += b * information[HEALTHY:]
            z = np.divide(
                score, np.sqrt(information), out=np.zeros_like(score), where=information > 1e-9
            )
            plain = np.zeros(len(z))
            debounced(z, plain_at, CONSECUTIVE, plain)
            paths = {
                "glr": glr_path(score, information, of.low, 1.0, of.one_sided)[0] / glr_at,
                "cusum": cusum_path(score, information, b, of.one_sided)[0] / known,
                "oracle": cusum_path(score, information, b, True)[0] / oracle,
                "plain": plain,
            }
            for name, path in paths.items():
                at = np.flatnonzero(path[HEALTHY:] >= 1.0)
                taken[name].append((float(at[0]) + 1.0 if len(at) else horizon) / of.per_hour)
        row = {"size": b * unit, "oracle_threshold": oracle, "cusum_threshold": known}
        for name, hours in taken.items():
            row[f"{name}_h"] = float(np.mean(hours))
            row[f"{name}_se_h"] = float(np.std(hours) / np.sqrt(len(hours)))
            row[f"{name}_missed"] = float(np.mean(np.array(hours) >= horizon / of.per_hour))
        row["cusum_over_oracle"] = row["cusum_h"] / row["oracle_h"]
        row["glr_over_oracle"] = row["glr_h"] / row["oracle_h"]
        rows.append(row)
    return rows


@njit
def debounced(z, threshold, count, path):  # type: ignore[no-untyped-def]
    """Fixed threshold with debouncing: consecutive samples beyond ``threshold`` over ``count``,
    into ``path`` (n); the test fails from 1 on."""
    consecutive = 0
    for k in range(len(z)):
        consecutive = consecutive + 1 if abs(z[k]) > threshold else 0
        path[k] = consecutive / count


def at_residual_level(
    machine: Machine, records: Sequence[Record], hours: float, trials: int
) -> dict[str, Any]:
    """Rates and delays of every fault by simulation; prints a line per fault and size."""
    units = {(e.name, n.key): n.upper for e in effects_for(machine) for n in e.gains}
    results: dict[str, Any] = {}
    for k, fault in enumerate(machine.faults):
        unit = units[fault.effect.name, fault.key]
        of = rates(records, fault, k, unit, hours, seed=100 + k)
        of |= {"unit": fault.gain.unit, "measured": measured(records, k)}
        of["delays"] = delays(records, fault, k, unit, of, trials, seed=200 + k)
        results[fault.name] = of
        for test in ("glr", "cusum"):
            print(
                f"{fault.name}: {test} {of[test]['alarms']} alarms in {hours:.0f} h, "
                f"{of[test]['expected']:.1f} expected",
                flush=True,
            )
        for row in of["delays"]:
            print(
                f"  {row['size']:.3g}: oracle {3600 * row['oracle_h']:.0f} s, "
                f"CUSUM ×{row['cusum_over_oracle']:.2f}, GLR ×{row['glr_over_oracle']:.2f}, "
                f"plain ×{row['plain_h'] / row['oracle_h']:.2f}",
                flush=True,
            )
    return results
