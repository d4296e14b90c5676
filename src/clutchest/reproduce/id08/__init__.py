"""[ID08] redone: ``steps`` (A1 … A4), ``ramps`` (A5 … A8) and ``deviations`` (A9) judge what it
states, ``figures`` draws them.

``rig`` runs the full model, with the shipped rig's parameters throughout; in A9 the generator plays
the measured rig.
"""

from __future__ import annotations

from functools import partial

from clutchest.progress import Progress
from clutchest.reproduce.claim import Claim, Reproduction, Row, judged
from clutchest.reproduce.id08 import deviations, ramps, steps
from clutchest.reproduce.id08.rig import Rig
from clutchest.vehicle import load_vehicle

TITLE = (
    "V. Ivanović, J. Deur, Z. Herold, M. Hancock, F. Assadian: Modeling and Experimental "
    "Validation of Active Limited Slip Differential Clutch Dynamics, "
    "IMECE2008-67411"
)
CLAIMS: tuple[Claim[Rig], ...] = (*steps.CLAIMS, *ramps.CLAIMS, *deviations.CLAIMS)


def reproduce(progress: Progress) -> Reproduction:
    """Every row and every figure."""
    rig = Rig(load_vehicle("alsd_rig"))
    rows: list[Row] = []
    for k, claim in enumerate(CLAIMS):
        progress(f"{claim.name}: {claim.what}", k / len(CLAIMS))
        rows.append(judged(claim, rig, {}))
    from clutchest.reproduce.id08.figures import draw

    data = {row.claim.name: row.verdict.data for row in rows}
    built_in = {
        e.words: (size, unit, f"the rig's own mechanism '{name}'")
        for e in deviations.DEVIATIONS
        for name, size, unit in e.sizes()
    }
    return Reproduction("id08", TITLE, rig.vehicle, tuple(rows), built_in, (), partial(draw, data))
