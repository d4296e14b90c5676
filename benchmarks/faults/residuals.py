"""Residuals drawn rather than driven: how often monitors fail in health, how soon with a fault.

Draws string whole recorded drives together in random order, so that every block tells as much as a
real one did; the monitors' own thresholds were found with shorter stretches and other numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clutchest.diagnosis.fault_tests import LEAST
from clutchest.diagnosis.sequential import debounced, peaks
from clutchest.diagnosis.thresholds import (
    WINDOW,
    Autoregression,
    cusum_path,
    from_path,
    glr_path,
    threshold,
)
from clutchest.models.fault import ModelFault

HOURS_PER_DRIVE = 0.5
ON_END = 3  # of the plain test
FRACTIONS = (0.5, 1.0, 2.0)  # of the smallest size that matters
SETTLED = 200  # blocks before the fault
PER_1000H = 1.0

Path_ = Callable[[np.ndarray, np.ndarray], np.ndarray]


def loaded(folder: Path) -> list[dict[str, np.ndarray]]:
    """The records of whole drives."""
    return [dict(np.load(path)) for path in sorted(folder.glob("*.npz"))]


def strung(
    records: Sequence[dict[str, np.ndarray]], k: int, blocks: int, rng: np.random.Generator
) -> np.ndarray:
    """Information about fault ``k`` in so many blocks: whole drives in random order."""
    pieces, count = [], 0
    while count < blocks:
        piece = records[rng.integers(len(records))]["information"][:, k].astype(float)
        pieces.append(piece)
        count += len(piece)
    return np.concatenate(pieces)[:blocks]


def measured(records: Sequence[dict[str, np.ndarray]], k: int) -> dict[str, float]:
    """Level, memory and tails of the residuals of whole simulated drives."""
    z = [r["z"][:, k][r["information"][:, k] > 0].astype(float) for r in records]
    every = np.concatenate(z)
    products = np.concatenate([x[1:] * x[:-1] for x in z])
    return {
        "blocks": len(every),
        "level": float(every.std()),
        "memory": float(products.mean() / every.var()) if len(every) else 0.0,
        "kurtosis": float(np.mean(every**4) / np.mean(every**2) ** 2) if len(every) else 0.0,
        "largest": float(np.abs(every).max()) if len(every) else 0.0,
    }


@dataclass(frozen=True)
class DriveSetup:
    """What the tests of one fault have in common: blocks ``per_hour``, false alarms ``per_block``,
    the information ``seen`` in each block, and the smallest ``size`` that matters, in units."""

    per_hour: float
    per_block: float
    seen: np.ndarray
    size: float
    one_sided: bool

    @classmethod
    def of(
        cls, records: Sequence[dict[str, np.ndarray]], fault: ModelFault, k: int, unit: float
    ) -> DriveSetup:
        """Of the ``k``-th fault in the records of whole drives."""
        per_hour = float(np.mean([len(r["z"]) for r in records])) / HOURS_PER_DRIVE
        seen = np.concatenate([r["information"][:, k] for r in records]).astype(float)
        return cls(
            per_hour, PER_1000H / 1000.0 / per_hour, seen, fault.size / unit, fault.gain.one_sided
        )

    @property
    def low(self) -> float:
        """The size at which the GLR begins to look."""
        return LEAST * self.size


def rates(
    records: Sequence[dict[str, np.ndarray]],
    fault: ModelFault,
    k: int,
    unit: float,
    hours: float,
    seed: int,
) -> dict[str, Any]:
    """Thresholds as a monitor finds them, and how often a healthy truck exceeds them in so many
    drawn hours."""
    rng, of = np.random.default_rng(seed), DriveSetup.of(records, fault, k, unit)
    tests: dict[str, Path_] = {
        "glr": lambda s, i: glr_path(s, i, of.low, 1.0, of.one_sided)[0],
        "cusum": lambda s, i: cusum_path(s, i, of.size, of.one_sided)[0],
    }
    blocks = int(hours * of.per_hour)
    information = strung(records, k, blocks, rng)
    score = np.sqrt(information) * rng.standard_normal(blocks)
    enabled = float(np.mean(information > 1e-6))
    found: dict[str, Any] = {"drawn_hours": hours, "enabled_share": enabled}
    for name, test in tests.items():
        h = threshold(test, of.seen, Autoregression(), of.per_block)
        count = len(peaks(test(score, information), h, WINDOW))
        expected = of.per_block * blocks
        found[name] = {
            "threshold": h,
            "alarms": count,
            "expected": expected,
            "per_1000_clock_hours": 1000.0 * count / hours,
            "per_1000_enabled_hours": 1000.0 * count / max(hours * enabled, 1e-9),
        }
    plain = _plain_threshold(information, rng, of.per_block)
    found["plain"] = {"threshold": plain, "on_end": ON_END}
    return found


def _plain_threshold(information: np.ndarray, rng: np.random.Generator, per_block: float) -> float:
    """The fixed threshold at which three on end are as seldom: chance per block p³, where p is
    that of one beyond it."""
    from scipy.stats import norm

    seen = float(np.mean(information > 1e-6))
    return float(norm.isf((per_block / max(seen, 1e-9)) ** (1.0 / ON_END) / 2.0))


def delays(
    records: Sequence[dict[str, np.ndarray]],
    fault: ModelFault,
    k: int,
    unit: float,
    found: dict[str, Any],
    trials: int,
    seed: int,
) -> list[dict[str, float]]:
    """Mean time to detection, h, of faults of several sizes: by the GLR that does not know the
    size, Page's test that does, the plain test, and an oracle.

    The oracle is Page's test with the true size and sign, its threshold found on draws of its own
    with whole drives' information, so that it alarms as seldom as the monitors do.
    """
    rng, of = np.random.default_rng(seed), DriveSetup.of(records, fault, k, unit)
    rows, glr_at, plain_at = [], found["glr"]["threshold"], found["plain"]["threshold"]
    for fraction in FRACTIONS:
        b = min(fraction * of.size, 1.0)
        long = strung(records, k, 3_000_000, rng)
        healthy = np.sqrt(long) * rng.standard_normal(len(long))
        oracle = from_path(cusum_path(healthy, long, b, True)[0], of.per_block)
        known = threshold(
            lambda s, i, b=b: cusum_path(s, i, b, of.one_sided)[0],
            of.seen,
            Autoregression(),
            of.per_block,
        )
        taken: dict[str, list[float]] = {"glr": [], "cusum": [], "plain": [], "oracle": []}
        horizon = 4000
        for _ in range(trials):
            information = strung(records, k, SETTLED + horizon, rng)
            score = np.sqrt(information) * rng.standard_normal(len(information))
            score[SETTLED:] += b * information[SETTLED:]
            z = np.divide(
                score, np.sqrt(information), out=np.zeros_like(score), where=information > 1e-9
            )
            plain = np.zeros(len(z))
            debounced(z, plain_at, ON_END, plain)
            paths = {
                "glr": glr_path(score, information, of.low, 1.0, of.one_sided)[0] / glr_at,
                "cusum": cusum_path(score, information, b, of.one_sided)[0] / known,
                "oracle": cusum_path(score, information, b, True)[0] / oracle,
                "plain": plain,
            }
            for name, path in paths.items():
                at = np.flatnonzero(path[SETTLED:] >= 1.0)
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
