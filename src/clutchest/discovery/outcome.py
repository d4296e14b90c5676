"""What became of a verdict when held-out drives were asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from clutchest.discovery.residual_curves import Curve
from clutchest.discovery.result import Cause, Gain
from clutchest.discovery.search import Search
from clutchest.discovery.verdict import errors_without_causes


@dataclass(frozen=True, slots=True)
class Outcome:
    """The verdict after held-out drives were asked: its ``name``, ``errors`` as curves, the
    ``curve`` that stands for an unnamed one or corrects the form of a cause, the ``gain``, and
    warnings; ``added``: effect → whether the curve of its form is added, in words."""

    name: str
    errors: Sequence[Curve]
    curve: Curve | None
    gain: Gain | None
    warnings: tuple[str, ...] = ()
    added: Mapping[str, str] = field(default_factory=dict)

    def with_forms(self, causes: Sequence[Cause]) -> tuple[Cause, ...]:
        """The causes, with what became of the curves of their forms."""
        return tuple(
            replace(c, form=replace(c.form, added=self.added.get(c.effect, ""))) for c in causes
        )

    def doubted_at(self, search: Search) -> Outcome:
        """The same where residuals are not noise, more surely than what was found is not."""
        errors = errors_without_causes(search) if self.named else self.errors
        return replace(self, name="unknown", errors=errors, curve=None, gain=None, added={})

    @property
    def named(self) -> bool:
        """Whether causes have names."""
        return self.name in ("named", "ambiguous")
