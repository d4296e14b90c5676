"""How results show themselves: one line where they are printed, a table in a notebook."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Shown:
    """A ``line`` that says what it is, and a table: ``header`` (c) and ``rows`` (n, c) of text."""

    line: str
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()

    @property
    def html(self) -> str:
        """As a notebook shows it."""
        head = "".join(f"<th>{escape(each)}</th>" for each in self.header)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(each)}</td>" for each in row) + "</tr>"
            for row in self.rows
        )
        table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        return f"<p>{escape(self.line)}</p>" + (table if self.rows else "")


class Showing(ABC):
    """What shows itself so; a dataclass that does says ``repr=False``."""

    __slots__ = ()

    @abstractmethod
    def shown(self) -> Shown:
        """The line and the table."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.shown().line}>"

    def _repr_html_(self) -> str:
        return self.shown().html


class Tabulated(Showing):
    """What is a table of numbers too."""

    __slots__ = ()

    @abstractmethod
    def rows(self) -> list[dict[str, Any]]:
        """Its rows, value by column."""

    @abstractmethod
    def column_units(self) -> dict[str, str]:
        """Column → unit of its values, where all have the same."""

    def to_pandas(self) -> pd.DataFrame:
        """The rows; the table's ``attrs["units"]`` are the units of its columns."""
        import pandas as pd

        table = pd.DataFrame(self.rows())
        table.attrs["units"] = self.column_units()
        return table

    def to_polars(self) -> Any:
        """The same as a DataFrame of polars, which must be installed; it has no place for units."""
        import polars

        return polars.from_pandas(self.to_pandas())


def plus_minus(value: float, std: float, unit: str = "") -> str:
    """A value with its standard deviation, as many digits as that deserves."""
    words = f"{value:.4g} ± {std:.2g}"
    return words if unit in ("", "1") else f"{words} {printed(unit)}"


def printed(unit: str) -> str:
    """A unit with its powers raised: ``Nm/mm³`` of ``Nm/mm^3``."""
    return re.sub(r"\^(-?\d+)", lambda power: power[1].translate(_RAISED), unit)
