"""The result of a procedure, and the files it becomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from clutchest import __version__
from clutchest.errors import UnknownNameError, nearest
from clutchest.paths import names_of
from clutchest.shown import (
    LARGE,
    MOST_DECIMALS,
    Shown,
    Tabulated,
    decimals,
    plain,
    plus_minus,
    with_exponent,
    with_unit,
)
from clutchest.vehicle import Vehicle, dump_vehicle

if TYPE_CHECKING:
    from rich.console import Console

QUANTITIES = {
    "noise": "standard deviation of a reading",
    "noise_ar": "correlation of its noise from sample to sample",
    "delay": "how late it is",
}
NOT_VALIDATED = (
    "not validated on other data: --holdout LOG (in Python: holdout) names a log that is kept out "
    "of the fit"
)


@dataclass(frozen=True, slots=True)
class Refit:
    """``value`` ± ``std`` of a parameter by the likelihood of all readings of the record from one
    ``bench``."""

    value: float
    std: float
    bench: str


@dataclass(frozen=True, slots=True)
class Fitted:
    """One number: ``value`` ± ``std``, 95 % interval ``low`` … ``high``, in ``unit``.

    ``prior_std`` is what was known before, None where nothing was.  Not ``determined``: ``why``
    says why, and ``value`` is the vehicle file's.  ``note``: what the number
    contains.  ``refit``: the same by the likelihood of a whole record, where that was asked for.
    """

    value: float
    unit: str
    std: float | None = None
    low: float | None = None
    high: float | None = None
    prior_std: float | None = None
    determined: bool = True
    why: str | None = None
    note: str | None = None
    refit: Refit | None = None

    @classmethod
    def unknown(cls, value: float, unit: str, why: str) -> Fitted:
        """The vehicle file's ``value``, which the log does not determine."""
        return cls(value, unit, determined=False, why=why)


@dataclass(frozen=True, slots=True)
class ErrorChange:
    """Root mean square error of a quantity in ``unit``, with the numbers of the file (``before``)
    and the fitted ones (``after``), None where it is never read; ``name`` in files, ``what`` it is
    in words."""

    name: str
    what: str
    unit: str
    before: float | None
    after: float | None


@dataclass(frozen=True, slots=True)
class Validation:
    """Numbers of the file and fitted ones on ``logs`` that were not used.

    ``errors`` of the machine's compared pair and of its sensors, all other numbers fitted within
    their spreads; ``gained``: by how much ln(probability) of the logs rose.
    """

    logs: tuple[str, ...]
    errors: tuple[ErrorChange, ...]
    gained: float

    def error(self, name: str) -> ErrorChange:
        """That of one quantity.  Raises ClutchestError where there is none."""
        names = [error.name for error in self.errors]
        if name not in names:
            raise UnknownNameError(f"no error of '{name}'{nearest(str(name), names)}")
        return self.errors[names.index(name)]

    def as_dict(self) -> dict[str, Any]:
        """As ``fit.json`` has it."""
        errors = {
            f"{e.name}_{when}": value
            for e in self.errors
            for when, value in (("before", e.before), ("after", e.after))
        }
        return {"logs": list(self.logs), **errors, "gained": self.gained}


@dataclass(frozen=True, slots=True)
class PictureFile:
    """A picture as a file would hold it, which a notebook shows."""

    name: str
    png: bytes = field(repr=False)

    def _repr_png_(self) -> bytes:
        return self.png


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Fit(Tabulated):
    """The result of one procedure.

    ``vehicle`` has the determined numbers in it.  ``parameters``: key in the vehicle file, dotted
    unless it is a parameter's, to its result.  ``draw`` writes the pictures into a folder.
    ``validation``: what the numbers are worth on logs not used to fit them, None without any.
    ``begun``: when the logs do, in words.  ``before``: the vehicle as it was given.
    """

    procedure: str
    vehicle: Vehicle
    sources: tuple[str, ...]
    parameters: Mapping[str, Fitted]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    draw: Callable[[Path], None] = field(compare=False)
    validation: Validation | None = None
    begun: str = ""
    before: Vehicle | None = None

    @property
    def by_name(self) -> Mapping[str, Fitted]:
        """The numbers."""
        return self.parameters

    def shown(self) -> Shown:
        """Every number with its standard deviation, or why it is not determined."""
        rows = [
            (
                key,
                plus_minus(f.value, f.std or 0.0, f.unit) if f.determined else "",
                "" if f.prior_std is None else f"{f.prior_std:.2g}",
                f.why or "",
            )
            for key, f in self.parameters.items()
        ]
        count = sum(f.determined for f in self.parameters.values())
        return Shown(
            f"{self.procedure} of {self.vehicle.name}, {count} of {len(rows)} numbers determined",
            ("number", "value", "σ before", "not determined"),
            rows,
        )

    def rows(self) -> list[dict[str, Any]]:
        """A row a number: its ``name``, and what :class:`Fitted` has."""
        return [{"name": name, **asdict(fitted)} for name, fitted in self.parameters.items()]

    def column_units(self) -> dict[str, str]:
        """None: every row has a unit of its own."""
        return {}

    def plot(self) -> list[PictureFile]:
        """The pictures that ``identify`` writes, by name."""
        with TemporaryDirectory() as folder:
            self.draw(Path(folder))
            return [PictureFile(p.name, p.read_bytes()) for p in sorted(Path(folder).iterdir())]

    def summary(self) -> dict[str, Any]:
        """The contents of ``fit.json``."""
        contents = {
            "procedure": self.procedure,
            "vehicle": self.vehicle.name,
            "logs": [Path(source).name for source in self.sources],
            "parameters": {key: asdict(fitted) for key, fitted in self.parameters.items()},
            "validation": None if self.validation is None else self.validation.as_dict(),
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        }
        return dict(plain(contents))

    def write_vehicle(self, path: Path, target: Path) -> None:
        """The vehicle as a file at ``path`` that will lie at ``target``; its heading says what was
        determined."""
        determined = [key for key, fitted in self.parameters.items() if fitted.determined]
        logs = names_of(self.sources)
        heading = (
            f"clutchest {__version__}, identify {self.procedure}, from {logs}:\n"
            + "\n".join(f"  {key}" for key in determined or ["nothing could be determined"])
            + f"\nAll else is {self.vehicle.path.name}'s.  Intervals: fit.json."
        )
        dump_vehicle(self.vehicle, path, heading, target)


@dataclass(frozen=True, slots=True)
class FitRow:
    """One number in words: its ``name``, of which ``leaf`` is the quantity of a signal; ``what`` it
    is; ``before`` and ``now`` with unit, the 95 % ``interval``, and a ``remark``: what it contains,
    or why it is not determined."""

    name: str
    leaf: str
    what: str
    before: str
    now: str
    interval: str
    remark: str


def fit_rows(fit: Fit, before: Vehicle) -> list[FitRow]:
    """Every number, beside the one that the vehicle file had ``before``."""
    what = {parameter.key: parameter.what for parameter in before.machine.parameters}
    rows = []
    for key, fitted in fit.parameters.items():
        if key in before.parameters:
            name, leaf, words = key, "", what.get(key, "")
            was = plus_minus(before.parameters[key].value, fitted.prior_std or 0.0, fitted.unit)
            now = plus_minus(fitted.value, fitted.std or 0.0, fitted.unit)
        else:
            section, _, leaf = key.rpartition(".")
            name = section.rpartition(".")[2]
            words = QUANTITIES.get(leaf, "")
            was = with_unit(f"{getattr(before.signals[name], leaf):.4g}", fitted.unit)
            now = with_unit(f"{fitted.value:.4g}", fitted.unit)
        if fitted.determined:
            remark = "; ".join(filter(None, (fitted.note, _refit_words(fitted))))
            rows.append(FitRow(name, leaf, words, was, now, interval(fitted), remark))
        else:
            rows.append(FitRow(name, leaf, words, was, "–", "", fitted.why or ""))
    return rows


def print_fit(fit: Fit, before: Vehicle, console: Console) -> None:
    """Print what was determined, and what could not be, against the file that it started from."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Column, Table

    rows = fit_rows(fit, before)
    of_signals = any(row.leaf for row in rows)
    named = ("signal", "quantity") if of_signals else ("parameter",)
    table = Table(
        *(Column(words, no_wrap=True) for words in named),  # on 80 columns, numbers give way
        "before",
        "fitted",
        "95 % interval",
        box=SIMPLE_HEAD,
        pad_edge=False,
        title=f"{fit.vehicle.name}: {fit.procedure}",
        title_justify="left",
    )
    last = ""
    for row in rows:
        first, last = ("" if row.name == last else row.name), row.name
        names = (first, row.leaf) if of_signals else (first,)
        words = "; ".join(filter(None, (row.interval, row.remark)))
        style = None if row.interval else "dim"
        table.add_row(*names, row.before, row.now, escape(words), style=style)
    console.print(table)
    if fit.validation is not None:
        console.print(escape(in_words(fit.validation)))
    for note in fit.notes:
        console.print(escape(note))
    for warning in fit.warnings:
        console.print(f"[yellow]warning:[/] {escape(warning)}")


def _refit_words(fitted: Fitted) -> str:
    if fitted.refit is None:
        return ""
    value = plus_minus(fitted.refit.value, fitted.refit.std, "")
    return f"by the likelihood of the record from {fitted.refit.bench}: {value}"


def interval(fitted: Fitted) -> str:
    """The 95 % interval, as many digits as it deserves."""
    assert fitted.low is not None and fitted.high is not None
    ends = (fitted.low, fitted.high)
    places = decimals(fitted.high - fitted.low, 3)
    if places > MOST_DECIMALS or abs(fitted.high) >= LARGE:
        low, high = (with_exponent(end, fitted.high - fitted.low, 3) for end in ends)
        return f"{low} … {high}"
    return f"{fitted.low:z.{places}f} … {fitted.high:z.{places}f}"


def in_words(validation: Validation) -> str:
    """The validation in a line."""
    words = [
        f"error of {e.what} {e.before:.3g} → {e.after:.3g} {e.unit}"
        for e in validation.errors
        if e.before is not None and e.after is not None
    ]
    return (
        f"Validation on {', '.join(validation.logs)}: {'; '.join(words)}; "
        f"ln(probability) {validation.gained:+.1f}"
    )
