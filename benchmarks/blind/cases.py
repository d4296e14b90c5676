"""From a case to its files: what is hidden and how large, the logs, the sealed answer."""

from __future__ import annotations

from dataclasses import asdict, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from blind.drives import Drive
from blind.near_misses import FOREIGN
from blind.oracle import Oracle
from blind.outsiders import Outsider
from blind.plan import Case, gains
from blind.sealed import seal
from clutchest.models import machine_of
from clutchest.models.effects import Number
from clutchest.reading.tables import write_signals
from clutchest.signals import Signals
from clutchest.vehicle import dump_vehicle

LOG, HELD_OUT, VEHICLE = "log.parquet", "held-out.parquet", "vehicle.toml"
NAMED = 12.0  # d′ from which on causes are to be named, and rivals matter
TRIES = 6  # drives, or pairs of effects, until one suits
LEAST_OF_PAIR = 0.5  # of the d′ aimed at: what each of a pair reaches in full
EXACT = 0.1  # of a size: what it need not be nearer to the d′ aimed at
NOTHING = 0.05  # of a first order's d′: less is none
CLOSE = 0.2  # the same of what an outsider leaves
SHARE = 0.25  # of the largest size: where the search for an outsider's size begins


Answer = dict[str, Any]


def answer(case: Case) -> Answer:
    """What is hidden in the case and what may be expected of whoever looks for it.

    ``effects``, ``outsider`` (name, size, phase or null), ``attempt`` (which of the case's drives),
    ``d_prime`` as it came out, ``one_sided``, ``rivals`` (effect → d′ from what is hidden; of two,
    each → that of the nearest that could stand for it; none where nothing is to be named),
    ``excited`` (gain → d′ at its largest plausible size); ``where`` of an outsider.
    """
    common: Answer = {"case": asdict(case), "attempt": 0, "effects": {}, "outsider": None}
    if case.part in ("null", "mismatch"):
        return common
    made = _MADE[case.part](case)
    return {**common, **made}


def drive_of(case: Case, known: Answer) -> Drive:
    return case.drive(known["attempt"])


def outsider_of(known: Answer) -> Outsider | None:
    given = known["outsider"]
    return FOREIGN[given["name"]](given["size"], given["phase"]) if given else None


def hidden(case: Case, known: Answer, *, held_out: bool = False) -> Signals:
    """The log with the cause in it, or the one held out."""
    drive = drive_of(case, known)
    return drive.signals(known["effects"], outsider_of(known), held_out=held_out)


def write(case: Case, folder: Path, sealed: Path, known: Answer | None = None) -> None:
    """The case's files: log, log held out and vehicle file under ``folder``, its answer in
    ``sealed``.  ``known``: the answer, where the oracle has been asked before."""
    known = answer(case) if known is None else known
    folder.mkdir(parents=True, exist_ok=True)
    write_signals(hidden(case, known), folder / LOG)
    write_signals(hidden(case, known, held_out=True), folder / HELD_OUT)
    dump_vehicle(drive_of(case, known).vehicle, folder / VEHICLE)
    sealed.parent.mkdir(parents=True, exist_ok=True)
    seal(known, sealed)


# --- sizes ---------------------------------------------------------------------------------------


def _effect(case: Case) -> Answer:
    """One effect; as large as plausible where its d′ cannot be reached."""
    oracle, random = Oracle(case.drive()), _random(case)
    name, key = case.cause.split(".")
    number, shape = _number(case, name, key), _shape(case, name, random)
    drawn = 1.0 if number.one_sided else float(random.choice((-1.0, 1.0)))

    def effects(size: float) -> dict[str, dict[str, float]]:
        return {name: {key: sign * size, **shape}}

    shapes = {(name, shaped): value for shaped, value in shape.items()}
    unit = oracle.per_largest(case.cause, shapes=shapes) / number.upper
    for sign in (drawn,) if number.one_sided else (drawn, -drawn):
        bound = number.upper if sign > 0 else -number.lower
        size = min(case.d_prime / max(unit, 1e-9), bound)
        twin = oracle.twin(effects(size))
        reached = oracle.distance(twin)
        if reached >= NOTHING * unit * size:
            break  # else it has nothing to change here: no share of heat is below nought
    for _ in range(2):
        nearer = min(size * case.d_prime / max(reached, 1e-9), bound)
        if abs(nearer - size) < EXACT * size:
            break
        size, twin = nearer, oracle.twin(effects(nearer))
        reached = oracle.distance(twin)
    near = oracle.nearest(twin) if case.d_prime >= NAMED else {}
    near.pop(name, None)
    return {
        "effects": effects(size),
        "d_prime": reached,
        "rivals": near,
        "one_sided": number.one_sided,
        "excited": oracle.excited(),
    }


def _two(case: Case) -> Answer:
    """Two effects, neither of which takes the other's place; what a third does is told with them
    (``rivals``)."""
    random, choice = _random(case), gains()
    for attempt in range(TRIES):
        oracle = Oracle(case.drive(attempt))
        for _ in range(10 * TRIES):
            pair = [choice[i] for i in random.choice(len(choice), 2, replace=False)]
            found = _pair(case, oracle, pair, random)
            if found:
                return {"attempt": attempt, **found}
    raise RuntimeError(f"{case.name}: no pair of effects suits its drives")


def _pair(case: Case, oracle: Oracle, pair: list[str], random: np.random.Generator) -> Answer:
    """The two effects at their sizes; empty where one would have to be implausibly large, or where
    in full, unlike to first order, it is next to nothing beside the other."""
    effects: dict[str, dict[str, float]] = {}
    names = [gain.split(".")[0] for gain in pair]
    if names[0] == names[1]:
        return {}
    for gain, other in zip(pair, reversed(names), strict=True):
        name, key = gain.split(".")
        number = _number(case, name, key)
        sign = 1.0 if number.one_sided else float(random.choice((-1.0, 1.0)))
        share = case.d_prime / max(oracle.per_largest(gain, other), 1e-9)
        if share * number.upper > (number.upper if sign > 0 else -number.lower):
            return {}
        effects[name] = {key: sign * share * number.upper, **_shape(case, name, random)}
    twin = oracle.twin(effects)
    each = {
        name: oracle.distance(twin, [other])
        for name, other in zip(names, reversed(names), strict=True)
    }
    if min(each.values()) < LEAST_OF_PAIR * case.d_prime:
        return {}
    near = {
        name: min(d for key, d in oracle.nearest(twin, [other]).items() if key != name)
        for name, other in zip(names, reversed(names), strict=True)
    }
    return {
        "effects": effects,
        "d_prime": min(each.values()),
        "rivals": near,
        "excited": oracle.excited(),
    }


def _outsider(case: Case) -> Answer:
    """An outsider of which so much is left when every single effect has been tried."""
    random, kind = _random(case), FOREIGN[case.cause]
    phase, found = float(random.uniform()), []
    for attempt in range(TRIES):
        oracle, outsider = Oracle(case.drive(attempt)), kind(SHARE * kind.largest, phase)
        # to first order, which is quick; where even that is too little, a whole search finds less
        outsider, near, off = _leaving(case, oracle, outsider, whole=False)
        if off >= -CLOSE:
            outsider, near, off = _leaving(case, oracle, outsider, whole=True)
        found.append(
            (
                abs(off),
                {
                    "attempt": attempt,
                    "d_prime": min(near.values()),
                    "rivals": near,
                    "outsider": {"name": kind.name, "size": outsider.size, "phase": phase},
                    "where": {
                        "equation": kind.equation,
                        "equations": list(kind.equations()),
                        "drivers": list(kind.drivers),
                    },
                    "alone": oracle.distance(oracle.twin(outsider=outsider)),
                    "excited": oracle.excited(),
                },
            )
        )
        if abs(off) < CLOSE:
            break
    return min(found, key=itemgetter(0))[1]


def _leaving(
    case: Case, oracle: Oracle, outsider: Outsider, whole: bool
) -> tuple[Outsider, dict[str, float], float]:
    """The ``outsider`` in a size that leaves as much as the case aims at, if it can; d′ from every
    effect, and by what share of the aim the least of them is off."""
    for left in range(2, -1, -1):
        near = oracle.nearest(oracle.twin(outsider=outsider), whole=whole)
        off = min(near.values()) / case.d_prime - 1.0
        most = off < 0.0 and outsider.size == outsider.largest
        if abs(off) < CLOSE or most or not left:
            break
        size = outsider.size * float(np.clip(1.0 / max(1.0 + off, 1e-9), 0.1, 10.0))
        outsider = replace(outsider, size=min(size, outsider.largest))
    return outsider, near, off


def _random(case: Case) -> np.random.Generator:
    return np.random.default_rng([case.seed, 2])


def _number(case: Case, name: str, key: str) -> Number:
    effect = machine_of(case.drive().vehicle.model).effects[name]
    return next(number for number in effect.gains if number.key == key)


def _shape(case: Case, name: str, random: np.random.Generator) -> dict[str, float]:
    """Shapes drawn within what a search tries, hardly ever on it."""
    effect = machine_of(case.drive().vehicle.model).effects[name]
    return {
        number.key: float(random.uniform(min(number.grid), max(number.grid)))
        for number in effect.parameters
        if number.shape and number.grid
    }


_MADE = {"effect": _effect, "two": _two, "outsider": _outsider, "near-miss": _outsider}
