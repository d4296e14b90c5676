"""Numbers as people and their programs write them: with a point or a comma, digits in groups."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from clutchest.errors import ClutchestError

if TYPE_CHECKING:
    import pandas as pd

    from clutchest.signals import Floats

# Blanks and apostrophes between groups can be nothing else.
_BETWEEN_GROUPS = r"(?<=\d)[ \u00a0\u2009\u202f'’](?=\d{3}(?!\d))"


def _form(mark: str, group: str) -> re.Pattern[str]:
    """Numbers with the decimal ``mark``, plain or with a ``group`` mark before three digits."""
    plain = rf"(\d+({mark}\d*)?|{mark}\d+)([eE][+-]?\d+)?"
    return re.compile(rf"[+-]?({plain}|[1-9]\d{{0,2}}({group}\d{{3}})+({mark}\d*)?)")


_POINT, _COMMA = _form(r"\.", ","), _form(",", r"\.")


def numbers_of(cells: pd.Series, comma: bool) -> Floats:
    """The numbers in ``cells`` (n,), objects counted from 0, NaN where there is none.

    Whether points or commas group digits is told by all cells of a column together; where they
    leave it open, commas are decimal marks if the file has such elsewhere (``comma``).  Raises
    ClutchestError where nothing tells it.
    """
    import pandas as pd

    value = pd.to_numeric(cells, errors="coerce").to_numpy(np.float64, na_value=np.nan).copy()
    texts = cells[cells.map(lambda cell: isinstance(cell, str)).to_numpy(bool)]
    marks = r"\d[.,' \u00a0\u2009\u202f’]" if comma else r"\d?[,' \u00a0\u2009\u202f’]\d"
    if not texts.str.contains(marks, regex=True).any():
        return value
    texts = texts.str.strip().str.replace(_BETWEEN_GROUPS, "", regex=True)
    kinds = pd.Series(texts.unique())
    point, with_comma = kinds.str.fullmatch(_POINT), kinds.str.fullmatch(_COMMA)
    only_point, only_comma = (point & ~with_comma).any(), (with_comma & ~point).any()
    if not only_point and (only_comma or comma):
        form, group, mark = _COMMA, ".", ","
    else:
        form, group, mark = _POINT, ",", "."
        open_ = kinds[point & with_comma & kinds.str.contains(",", regex=False)]
        if not only_point and len(open_):
            raise _undecided(str(open_.iloc[0]))
        if only_comma:  # with points in some cells, commas in others
            texts = texts[~texts.str.fullmatch(_COMMA)]
    texts = texts[texts.str.fullmatch(form)]
    plain = texts.str.replace(group, "", regex=False).str.replace(mark, ".", regex=False)
    value[texts.index.to_numpy()] = pd.to_numeric(plain, errors="coerce")
    return value


def _undecided(cell: str) -> ClutchestError:
    whole = cell.replace(",", "")
    return ClutchestError(
        f"'{cell}' may be {whole} or {cell.replace(',', '.')}: write the numbers with a decimal "
        "point and digits that are not grouped"
    )
