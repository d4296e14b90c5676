"""The cases of the blind suite: enumerated, always the same, in an order drawn once for all."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from blind.drives import NOISES, VEHICLE, Drive
from blind.near_misses import NEAR_MISSES
from blind.outsiders import OUTSIDERS
from clutchest import load_vehicle
from clutchest.generator import GROUPS
from clutchest.models import machine_of

PARTS = ("null", "mismatch", "effect", "two", "outsider", "near-miss")
ALL = "all"  # mismatches at once
SIZES = (2.0, 3.0, 4.0, 5.0, 6.0, 12.0, 20.0)  # d′ of single effects
TWO = 10.0  # d′ of each of two effects, the other projected out
LEFTOVER = (9.0, 15.0)  # of outsiders, when every single effect has been tried
MISMATCHES, NEAR = 40, 10  # cases per group of mismatches; per near miss and size
NULLS, SEEDS, PAIRS = 1000, 20, 400  # per noise kind; per effect and size; in all
QUICK = {"null": 32, "effect": 60, "two": 6, "outsider": 22}  # cases of the fixed short run


@dataclass(frozen=True)
class Case:
    """``cause``: ``effect.gain``, an outsider, a group of mismatches, or empty where the seed draws
    it; ``d_prime`` aimed at; ``number`` tells cases alike apart."""

    part: str
    cause: str
    d_prime: float
    noise: str
    number: int

    @property
    def name(self) -> str:
        return "-".join(
            (self.part, self.cause or "any", f"{self.d_prime:g}", self.noise, str(self.number))
        )

    @property
    def blind_name(self) -> str:
        """A name that tells nothing."""
        return hashlib.sha256(self.name.encode()).hexdigest()[:12]

    @property
    def seed(self) -> int:
        """Of everything drawn; cases share none."""
        return int(self.blind_name[:8], 16)

    def drive(self, attempt: int = 0) -> Drive:
        """The drive; another one where the first does not suit."""
        mismatches: tuple[str, ...] = ()
        if self.part == "mismatch":
            mismatches = tuple(GROUPS) if self.cause == ALL else (self.cause,)
        return Drive(self.seed + attempt * 2**32, self.noise, mismatches)


def gains() -> list[str]:
    """``effect.gain`` of every effect in the library."""
    effects = machine_of(load_vehicle(VEHICLE).model).effects
    return [f"{name}.{number.key}" for name, effect in effects.items() for number in effect.gains]


def full(first: int = 0) -> list[Case]:
    """Every case, part by part, numbered from ``first`` on; noise kinds take turns within each
    cause and size."""
    noises = list(NOISES)
    cases = [Case("null", "", 0.0, noise, first + i) for noise in noises for i in range(NULLS)]
    for part, causes, sizes in (
        ("effect", gains(), SIZES),
        ("outsider", list(OUTSIDERS), LEFTOVER),
        ("near-miss", list(NEAR_MISSES), LEFTOVER),
    ):
        count = NEAR if part == "near-miss" else SEEDS
        for cause, (k, size), i in product(causes, enumerate(sizes), range(count)):
            cases.append(Case(part, cause, size, noises[(i + k) % len(noises)], first + i))
    cases += [Case("two", "", TWO, noises[i % len(noises)], first + i) for i in range(PAIRS)]
    for k, group in enumerate((*GROUPS, ALL)):
        of = (noises[(i + k) % len(noises)] for i in range(MISMATCHES))
        cases += [Case("mismatch", group, 0.0, noise, i) for i, noise in enumerate(of, first)]
    return cases


def drawn(parts: Sequence[str], limit: int | None = None, first: int = 0) -> list[Case]:
    """The cases of these parts in an order drawn once for all, the first ``limit`` of them."""
    cases = [case for case in full(first) if case.part in parts]
    order = np.random.default_rng(0).permutation(len(cases))
    return [cases[i] for i in order[:limit]]


def each(parts: Sequence[str], count: int, after: int = 0, first: int = 0) -> list[Case]:
    """``count`` cases of every cause in these parts ``after`` so many, in the order drawn."""
    taken: dict[tuple[str, str], int] = {}
    chosen = []
    for case in drawn(parts, first=first):
        kind = case.part, case.cause or case.noise
        taken[kind] = taken.get(kind, 0) + 1
        if after < taken[kind] <= after + count:
            chosen.append(case)
    return chosen


def quick() -> list[Case]:
    """The fixed short run: as many of every part as QUICK says, causes and noises in turn."""
    chosen = []
    for part, count in QUICK.items():
        by_cause: dict[str, list[Case]] = {}
        for case in drawn([part]):
            by_cause.setdefault(case.cause or case.noise, []).append(case)
        turns = [case for cases in zip(*by_cause.values(), strict=False) for case in cases]
        chosen += turns[:count]
    return chosen
