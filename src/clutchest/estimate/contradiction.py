"""Signals and model that cannot both be right."""

from __future__ import annotations

from dataclasses import dataclass

MISFIT = "misfit"  # kind of a contradiction that a large effect of the library can be


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Signals and model that cannot both be right: ``words`` say how that shows, ``signal`` is the
    one most in question, from ``since_s`` on the drive's clock no state is believed.
    ``explanation`` in words, "" where none was sought, its ``kind``: sign, swap, unit, dead, ratio,
    bench, "" where there is none; ``others``: signals that are in question as much.  Where the kind
    is misfit an error that fault tests look for may be the reason."""

    words: str
    signal: str
    since_s: float
    explanation: str = ""
    kind: str = ""
    others: tuple[str, ...] = ()

    @property
    def is_explained(self) -> bool:
        """Whether it is known what is wrong."""
        return self.kind not in ("", MISFIT)
