"""Writes docs/effects.md from the library of effects.

python docs/make_effects.py
"""

from __future__ import annotations

import inspect
from pathlib import Path

from clutchest.models import machine_of
from clutchest.models.effects import Effect, Number
from clutchest.shown import with_unit

PAGE = Path(__file__).with_name("effects.md")
HEADING = """# Effects

Terms added to the equations of the papers. Each is absent at 0. A vehicle file adds one to the
estimator's model (`[effects]`), `clutchest simulate --effect wear:amount=0.5` to the truth of a
simulated drive.

The range is that of plausible values; where it begins at 0, only positive values are physical. A
number with a default is a shape: it sets the form of the effect, not its size. The equation is the
part of the model in which the effect acts.

Beside these, every machine that declares error terms has the effect `curve`: an error of one
equation as a curve over one covariate, its knots, values and covariance in the vehicle file
([vehicle-file.md](vehicle-file.md)). `clutchest discover` writes one where no named effect
explains the data. The generator does not have it.

This page is written by `python docs/make_effects.py`.
"""
TITLES = {"dry_clutch": "The dry clutch", "alsd": "The active limited-slip differential"}
TABLE = """
## {title}

| effect | what it does | numbers | equation |
|---|---|---|---|
"""


def page() -> str:
    """The whole page as Markdown."""
    tables = (
        TABLE.format(title=title) + "".join(map(_row, machine_of(model).effects.values()))
        for model, title in TITLES.items()
    )
    return HEADING + "".join(tables)


def _row(effect: Effect) -> str:
    first_paragraph = inspect.cleandoc(type(effect).__doc__ or "").split("\n\n")[0]
    what = " ".join(first_paragraph.split()).replace("``", "`").replace("|", "\\|")
    numbers = "<br>".join(map(_number, effect.parameters))
    return f"| `{effect.name}` | {what} | {numbers} | {effect.equation} |\n"


def _number(number: Number) -> str:
    default = f", default {number.default:g}" if number.shape else ""
    limits = with_unit(f"{number.lower:g} … {number.upper:g}", number.unit)
    return f"`{number.key}` {limits}{default}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
