"""Papers reproduced: their figures drawn again, every figure they state judged.

One package per paper, listed here.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from clutchest.errors import ClutchestError, nearest

if TYPE_CHECKING:
    from clutchest.progress import Progress
    from clutchest.reproduce.claim import Reproduction


@dataclass(frozen=True, slots=True)
class Paper:
    """``title`` in a few words; ``module`` has ``reproduce(progress)``, loaded when it is
    first asked for."""

    name: str
    title: str
    module: str

    def __call__(self, progress: Progress) -> Reproduction:
        """Redo the paper's experiments."""
        reproduction: Reproduction = import_module(self.module).reproduce(progress)
        return reproduction


PAPERS = {
    p.name: p
    for p in (
        Paper(
            "me12",
            "Myklebust, Eriksson: Torque Model with Fast and Slow Temperature Dynamics of a "
            "Slipping Dry Clutch, IEEE VPPC 2012",
            "clutchest.reproduce.me12",
        ),
        Paper(
            "id08",
            "Ivanović, Deur, Herold, Hancock, Assadian: Modeling and Experimental Validation of "
            "Active Limited Slip Differential Clutch Dynamics, IMECE2008-67411",
            "clutchest.reproduce.id08",
        ),
    )
}


def paper(name: str) -> Paper:
    """The paper of that name.  Raises ClutchestError naming the nearest one."""
    if name not in PAPERS:
        raise ClutchestError(f"unknown paper '{name}'" + nearest(name, PAPERS))
    return PAPERS[name]
