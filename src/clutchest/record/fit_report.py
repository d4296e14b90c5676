"""A fit in words: every number with its interval, or why it is not determined."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from clutchest.identify.fit import Fit, in_words, interval
from clutchest.record.report import table
from clutchest.shown import plus_minus

HEAD = ("number", "value ± 1σ", "95 %", "σ before", "note, or why it is not determined")


def fit_markdown(fit: Fit, pictures: Sequence[str] = ()) -> str:
    """One page of Markdown; ``pictures`` are file names."""
    rows = []
    for key, fitted in fit.parameters.items():
        prior = "" if fitted.prior_std is None else f"{fitted.prior_std:.2g}"
        if fitted.determined:
            value = plus_minus(fitted.value, fitted.std or 0.0, fitted.unit)
            rows.append((key, value, interval(fitted), prior, fitted.note or ""))
        else:
            rows.append((key, "–", "–", prior, fitted.why or ""))
    logs = ", ".join(Path(source).name for source in fit.sources)
    parts = [f"# {fit.shown().line}", f"From {logs}.", table(HEAD, rows)]
    if fit.validation is not None:
        parts += ["## On logs that were not used", in_words(fit.validation)]
    if pictures:
        parts.append("## Data and fit")
        parts += [f"![{Path(name).stem.replace('_', ' ')}]({name})" for name in pictures]
    parts += list(fit.notes)
    if fit.warnings:
        parts += ["## Warnings", "\n".join(f"- {text}" for text in fit.warnings)]
    return "\n\n".join(parts) + "\n"
