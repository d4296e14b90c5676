"""What a procedure found, and the files it becomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest import __version__
from clutchest.vehicle import Vehicle
from clutchest.vehicle.text import vehicle_text

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True, slots=True)
class Fitted:
    """One number: ``value`` ± ``std``, 95 % interval ``low`` … ``high``, in ``unit``.

    ``prior_std`` is what was known before, None where nothing was.  Not ``determined``: the log
    cannot tell, ``why`` says why, and ``value`` is the vehicle file's.  ``note``: what the number
    contains.
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

    @classmethod
    def unknown(cls, value: float, unit: str, why: str) -> Fitted:
        """The vehicle file's ``value``, because the log cannot tell."""
        return cls(value, unit, determined=False, why=why)


@dataclass(frozen=True, slots=True)
class Fit:
    """The result of one procedure.

    ``vehicle`` has the found numbers in it.  ``parameters``: key in the vehicle file, dotted, to
    what was found.  ``draw`` writes the pictures into a folder.
    """

    procedure: str
    vehicle: Vehicle
    sources: tuple[str, ...]
    parameters: Mapping[str, Fitted]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    draw: Callable[[Path], None]

    def as_dict(self) -> dict[str, Any]:
        """The contents of ``fit.json``."""
        return {
            "procedure": self.procedure,
            "vehicle": self.vehicle.name,
            "logs": [Path(source).name for source in self.sources],
            "parameters": {key: asdict(fitted) for key, fitted in self.parameters.items()},
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        }

    def vehicle_toml(self, target: Path) -> str:
        """The vehicle as text for a file at ``target``; its heading says what was found where."""
        found = [key for key, fitted in self.parameters.items() if fitted.determined]
        logs = ", ".join(Path(source).name for source in self.sources)
        heading = (
            f"clutchest {__version__}, identify {self.procedure}, from {logs}:\n"
            + "\n".join(f"  {key}" for key in found or ["nothing could be determined"])
            + f"\nAll else is {self.vehicle.path.name}'s.  Intervals: fit.json."
        )
        return vehicle_text(self.vehicle, target, heading)


def print_fit(fit: Fit, before: Vehicle, console: Console) -> None:
    """Print what was found, and what could not be, against the file that it started from."""
    from rich.markup import escape
    from rich.table import Table

    table = Table("signal", "", "was", "is", "95 %", title=f"{fit.vehicle.name}: {fit.procedure}",
                  title_justify="left")  # fmt: skip
    last = ""
    for key, fitted in fit.parameters.items():
        section, _, leaf = key.rpartition(".")
        name = section.rpartition(".")[2]
        was = getattr(before.signals[name], leaf)
        unit = "" if fitted.unit == "1" else f" {fitted.unit}"
        first, last = ("" if name == last else name), name
        if fitted.determined:
            span = f"{fitted.low:.3g} … {fitted.high:.3g}"
            note = f"; {fitted.note}" if fitted.note else ""
            table.add_row(first, leaf, f"{was:.4g}", f"{fitted.value:.4g}{unit}",
                          escape(span + note))  # fmt: skip
        else:
            table.add_row(first, leaf, f"{was:.4g}", "–", escape(fitted.why or ""), style="dim")
    console.print(table)
    for note in fit.notes:
        console.print(escape(note))
    for warning in fit.warnings:
        console.print(f"[yellow]warning:[/] {escape(warning)}")
