"""[ME12] redone: one file per experiment with what it shows (D1 … D10, k_P).

``figures`` draws them, ``data`` makes the stand-in for the paper's measurements, ``model`` runs the
paper's model beside it.  All rows hold for one parameter set, the shipped truck's.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from importlib.resources import files

from clutchest.progress import Progress
from clutchest.reproduce.claim import Claim, Margin, Reproduction, Row, judged
from clutchest.reproduce.me12 import (
    curve,
    delay,
    expansion,
    heat,
    launch,
    limits,
    pulses,
    slip,
    split,
)
from clutchest.reproduce.me12.data import Setup
from clutchest.vehicle import load_vehicle

TITLE = (
    "A. Myklebust, L. Eriksson: Torque Model with Fast and Slow Temperature Dynamics of a "
    "Slipping Dry Clutch, IEEE VPPC 2012"
)
VEHICLE = "truck"
CLAIMS: tuple[Claim[Setup], ...] = (
    *curve.CLAIMS,
    *slip.CLAIMS,
    *expansion.CLAIMS,
    *heat.CLAIMS,
    *pulses.CLAIMS,
    *launch.CLAIMS,
    *delay.CLAIMS,
    *limits.CLAIMS,
    *split.CLAIMS,
)
MARGINS = "margins.json"  # written by benchmarks/margins.py


def setup() -> Setup:
    """The shipped truck, as the model has it and with the stated imperfections as the truth."""
    vehicle = load_vehicle(VEHICLE)
    return Setup(vehicle, vehicle)


def reproduce(progress: Progress) -> Reproduction:
    """Every row and every figure."""
    with_all = setup()
    known = margins(with_all)
    rows: list[Row] = []
    for k, claim in enumerate(CLAIMS):
        progress(f"{claim.name}: {claim.what}", k / len(CLAIMS))
        rows.append(judged(claim, with_all, known.get(claim.name, {})))
    notes = (
        ()
        if known
        else (
            "how far imperfections may grow is not known for these numbers: "
            "python benchmarks/margins.py measures it",
        )
    )
    from clutchest.reproduce.me12.figures import draw

    data = {row.claim.name: row.verdict.data for row in rows}
    return Reproduction(
        "me12",
        TITLE,
        with_all.vehicle,
        tuple(rows),
        with_all.imperfections.sizes(),
        notes,
        partial(draw, data),
    )


def margins(of: Setup) -> Mapping[str, Mapping[str, Margin]]:
    """Row → imperfection → how far it may grow, as computed before; empty where that was for other
    numbers."""
    stored = files(__package__).joinpath(MARGINS)
    if not stored.is_file():
        return {}
    margins = json.loads(stored.read_text(encoding="utf-8"))
    if margins["numbers"] != numbers(of):
        return {}
    return {
        row: {name: Margin(**margin) for name, margin in of_row.items()}
        for row, of_row in margins["rows"].items()
    }


def numbers(of: Setup) -> dict[str, float]:
    """What margins depend on: parameters of the vehicle, and sizes of the imperfections."""
    parameters = {key: p.value for key, p in of.vehicle.parameters.items()}
    return {**parameters, **asdict(of.imperfections)}


__all__ = ["CLAIMS", "MARGINS", "Claim", "Setup", "margins", "numbers", "reproduce", "setup"]
