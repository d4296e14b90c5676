"""How results show themselves: one line where they are printed, a table in a notebook."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from html import escape
from math import floor, isfinite, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from clutchest.checked import checked
from clutchest.errors import UnknownNameError, nearest

if TYPE_CHECKING:
    import pandas as pd

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MOST_DECIMALS, LARGE = 6, 1e6  # beyond, a number is easier to read with an exponent

# units are written with one division; people say "per", and name a speed as one
_AS_READ = (
    (re.compile(r"1/\(?([^()]+)\)?"), r"per \1"),
    (re.compile(r"(?:(.+) )?s/\((\d+ \w+)\)"), r"\1 per \2/s"),
    (re.compile(r"s\^2/\((\d+ \w+)\)\^2"), r"per (\1/s)^2"),
)


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


class Comparable:
    """What is equal to another of its class where all parts are, arrays number by number; a
    dataclass that is says ``eq=False``."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return same(self, other)

    __hash__ = None  # type: ignore[assignment]


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal; a number that is missing equals another that is."""
    if is_dataclass(one):
        names = [field.name for field in fields(one) if field.compare]
        alike = type(one) is type(other)
        return alike and all(same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, Mapping):
        alike = isinstance(other, Mapping) and one.keys() == other.keys()
        return alike and all(same(value, other[key]) for key, value in one.items())
    if isinstance(one, list | tuple):
        alike = isinstance(other, list | tuple) and len(one) == len(other)
        return alike and all(map(same, one, other))
    if hasattr(one, "dtype"):
        import numpy as np

        return bool(np.array_equal(one, other, equal_nan=one.dtype.kind == "f"))
    return bool(one == other or (one != one and other != other))


class Showing(Comparable, ABC):
    """What shows itself so; a dataclass that does says ``repr=False, eq=False``."""

    __slots__ = ()

    @abstractmethod
    def shown(self) -> Shown:
        """The line and the table."""

    @checked
    def save(self, path: str | Path, **options: Any) -> list[Path]:
        """Write it to ``path``; see :func:`clutchest.save`."""
        import clutchest  # which knows every kind of result, and where it is written

        return clutchest.save(self, path, **options)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.shown().line}>"

    def _repr_html_(self) -> str:
        return self.shown().html


class Tabulated(Showing):
    """What is a table of numbers too, and has parts by name: ``fit["kiss_point"]``.  ``COLUMNS`` of
    one that may have no row."""

    __slots__ = ()
    COLUMNS: ClassVar[Sequence[str]] = ()

    @property
    @abstractmethod
    def by_name(self) -> Mapping[str, Any]:
        """What its names stand for."""

    def __getitem__(self, name: str) -> Any:
        found = self.by_name
        if not isinstance(name, str) or name not in found:
            hint = nearest(str(name), found) or "; there is none"
            raise UnknownNameError(f"no '{name}' in this {type(self).__name__}{hint}")
        return found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.by_name)

    def __contains__(self, name: object) -> bool:
        return name in self.by_name

    @abstractmethod
    def rows(self) -> list[dict[str, Any]]:
        """Its rows, value by column."""

    @abstractmethod
    def column_units(self) -> dict[str, str]:
        """Column → unit of its values, where all have the same."""

    def to_pandas(self) -> pd.DataFrame:
        """The rows; the table's ``attrs["units"]`` are the units of its columns."""
        import pandas as pd

        table = pd.DataFrame(self.rows(), columns=self.COLUMNS or None)
        table.attrs["units"] = self.column_units()
        return table

    def to_polars(self) -> Any:
        """The same as a DataFrame of polars, which must be installed; it has no place for units."""
        import polars

        return polars.from_pandas(self.to_pandas())


def plain(value: Any) -> Any:
    """``value`` as what JSON has words for: a number that is missing or not finite is None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy's
        return plain(value.tolist())
    return None if isinstance(value, float) and not isfinite(value) else value


def plus_minus(value: float, std: float, unit: str = "") -> str:
    """A value with its standard deviation, as many digits as that supports."""
    return with_unit(rounded(value, std), unit)


def rounded(value: float, std: float) -> str:
    """``82.1 ± 3.4``: the value is given to the digits that its uncertainty supports."""
    places = decimals(std, 2) if std > 0 else decimals(value, 4)
    if places > MOST_DECIMALS or abs(value) >= LARGE:
        return f"{with_exponent(value, std, 2)} ± {std:.2g}"
    return f"{value:z.{places}f} ± {std:.{places}f}"


def with_exponent(value: float, of: float, digits: int) -> str:
    """``value`` to the place where ``of`` has so many significant digits: four digits at least,
    fifteen, which is all that a number holds, at most."""
    if value == 0 or of == 0 or not isfinite(value / of):
        return f"{value:.4g}"
    more = floor(log10(abs(value))) - floor(log10(abs(of))) + digits
    return f"{value:.{min(max(more, 4), 15)}g}"


def decimals(value: float, digits: int) -> int:
    """After how many decimals ``value`` has so many significant digits."""
    if value == 0 or not isfinite(value):
        return 0
    return max(0, digits - 1 - floor(log10(abs(value))))


def counted(number: int, what: str) -> str:
    """``1 drive``, ``4 drives``."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def with_unit(number: str, unit: str) -> str:
    """A number with its unit as people read it; a pure number alone."""
    return number if unit in ("", "1") else f"{number} {printed(unit)}".lstrip()


def printed(unit: str) -> str:
    """A unit as people read it: ``Nm/mm³`` of ``Nm/mm^3``, ``per 100 K`` of ``1/(100 K)``,
    ``Nm per 100 rad/s`` of ``Nm s/(100 rad)``, ``per (100 rad/s)²`` of ``s^2/(100 rad)^2``."""
    for form, words in _AS_READ:
        if match := form.fullmatch(unit):
            return raised(match.expand(words).strip())
    return raised(unit)


def raised(text: str) -> str:
    """With its powers raised: ``10¹¹`` of ``10^11``."""
    return re.sub(r"\^(-?\d+)", lambda power: power[1].translate(_RAISED), text)
