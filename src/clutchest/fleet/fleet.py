"""From logs of many vehicles to a dataset, a table of vehicles, and those that differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest import __version__
from clutchest.checked import checked
from clutchest.errors import ClutchestError
from clutchest.extras import required
from clutchest.fleet.cluster import alone, client_of, in_turn, settle, survived
from clutchest.fleet.comparison import FEWEST, FleetComparison, outliers
from clutchest.fleet.imprint import Passed
from clutchest.fleet.logs import FleetLog, logs_of, numbered
from clutchest.fleet.one_log import LogTask, begin_of, estimate_log, read_row, reject
from clutchest.models.machine import Machine
from clutchest.paths import as_written
from clutchest.progress import Progress, silent
from clutchest.quantity import Quantity
from clutchest.shown import Shown, Tabulated, counted, plus_minus
from clutchest.vehicle import Vehicle, load_vehicle
from clutchest.vehicle.text import vehicle_text

if TYPE_CHECKING:
    from distributed import Client, Future

    from clutchest.pictures import Picture

WEAR_RATE = "wear_per_MJ"
LOST = "every worker that read it was lost: is memory short?"
FIRST_DAY = "2001-01-01"  # clocks that have lost their date begin in 1970, 1980 or 2000
Z = 1.96  # standard deviations of a 95 % interval


@dataclass(frozen=True, slots=True)
class FleetVehicle:
    """One vehicle after its last drive: ``logs`` used and ``rejected`` (log → why), ``drives`` as
    ``one_log.drives_of`` has them, each with its ``log``; ``properties`` name → (value, std) of
    what it keeps while it stands, where they are valid; ``wear`` as ``summary.json`` has it, None
    where there is none; ``notes`` (log → why the clock of one that is used is not relied on)."""

    name: str
    logs: tuple[str, ...]
    rejected: Mapping[str, str]
    drives: tuple[Mapping[str, Any], ...]
    properties: Mapping[str, tuple[float, float]]
    wear: Mapping[str, Any] | None
    notes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Fleet(Tabulated):
    """All vehicles, and property → (what the others lead one to expect, which differ (v,))."""

    vehicle: Vehicle
    vehicles: tuple[FleetVehicle, ...]
    compared: Mapping[str, tuple[FleetComparison, np.ndarray]]

    @property
    def by_name(self) -> Mapping[str, FleetVehicle]:
        """The vehicles."""
        return {one.name: one for one in self.vehicles}

    @property
    def outliers(self) -> dict[str, list[str]]:
        """Vehicle → the properties in which it differs from the fleet."""
        found: dict[str, list[str]] = {}
        for name, (_, differ) in self.compared.items():
            for k in np.flatnonzero(differ):
                found.setdefault(self.vehicles[k].name, []).append(name)
        return found

    @property
    def rejected(self) -> dict[str, str]:
        """Logs that could not be used → why."""
        return {log: why for one in self.vehicles for log, why in one.rejected.items()}

    @property
    def notes(self) -> dict[str, str]:
        """Logs that are used → why their clocks are not relied on."""
        return {log: note for one in self.vehicles for log, note in one.notes.items()}

    @property
    def contradicting(self) -> dict[str, str]:
        """Logs whose signals contradict the model, so that none of their estimates count → how that
        shows, and what explains it."""
        drives = (drive for one in self.vehicles for drive in one.drives)
        return {d["log"]: d["contradiction"] for d in drives if d.get("contradiction")}

    def differences(self) -> list[str]:
        """In words, which vehicle differs from the fleet, in what, and by how much."""
        words = []
        for name, (comparison, differ) in self.compared.items():
            for k in np.flatnonzero(differ):
                one, quantity = self.vehicles[k], self._quantity(name)
                value, usual = (
                    plus_minus(*self._read(name, *each), quantity.shown)
                    for each in (
                        one.properties[name],
                        (comparison.expected[k], comparison.spread[k]),
                    )
                )
                words.append(
                    f"{one.name}: {quantity.words} {value}, the other vehicles lead one to expect "
                    f"{usual} (p = {comparison.p_value[k]:.1g})"
                )
        return words

    @property
    def units(self) -> dict[str, str]:
        """Property → unit."""
        return units_of(self.vehicle.machine)

    def _quantity(self, name: str) -> Quantity:
        return Quantity(name, self.units[name])

    def _read(self, name: str, value: float, std: float) -> tuple[float, float]:
        """A property and its standard deviation in the unit that people read."""
        quantity = self._quantity(name)
        return float(quantity.read(np.array(value))), float(quantity.read_spread(np.array(std)))

    def rows(self) -> list[dict[str, Any]]:
        """One row a vehicle, as ``summary.parquet`` holds it."""
        rows = []
        for k, one in enumerate(self.vehicles):
            row: dict[str, Any] = {
                "vehicle": one.name,
                "logs": len(one.logs),
                "rejected": len(one.rejected),
                "drives": len(one.drives),
                "hours": sum(d["duration_s"] for d in one.drives) / 3600.0,
                "slip_events": sum(d["slip_events"] for d in one.drives),
                "slip_energy_MJ": sum(d["slip_energy_J"] for d in one.drives) / 1e6,
            }
            for name, (comparison, differ) in self.compared.items():
                value, std = one.properties.get(name, (np.nan, np.nan))
                row |= {
                    name: value,
                    f"{name}_std": std,
                    f"{name}_low": value - Z * std,
                    f"{name}_high": value + Z * std,
                    f"{name}_expected": comparison.expected[k],
                    f"{name}_spread": comparison.spread[k],
                    f"{name}_p": comparison.p_value[k],
                    f"{name}_outlier": bool(differ[k]),
                }
            rows.append(row)
        return rows

    def column_units(self) -> dict[str, str]:
        """Column of the rows → unit."""
        ends = ("", "_std", "_low", "_high", "_expected", "_spread")
        compared = {f"{name}{end}": self.units[name] for name in self.compared for end in ends}
        return {"hours": "h", "slip_energy_MJ": "MJ", **compared}

    def plot(self) -> Picture:
        """Every property of every vehicle ± 2σ, what the others lead one to expect in grey; red
        where it differs."""
        from clutchest.fleet.picture import draw_fleet

        missing = (np.nan, np.nan)
        quantities = {name: self._quantity(name) for name in self.compared}
        numbers = {
            quantity: tuple(np.array([v.properties.get(name, missing) for v in self.vehicles]).T)
            for name, quantity in quantities.items()
        }
        compared = {quantities[name]: each for name, each in self.compared.items()}
        return draw_fleet([v.name for v in self.vehicles], numbers, compared)

    def shown(self) -> Shown:
        """The vehicles with their properties; an exclamation mark where one differs."""
        names = list(self.compared)
        rows = []
        for k, one in enumerate(self.vehicles):
            cells = [one.name, str(len(one.drives))]
            for name in names:
                if name in one.properties:
                    mark = " !" if self.compared[name][1][k] else ""
                    cells.append(plus_minus(*self._read(name, *one.properties[name])) + mark)
                else:
                    cells.append("")
            rows.append(tuple(cells))
        head = [self._quantity(name).label for name in names]
        count, line = len(self.outliers), counted(len(self.vehicles), "vehicle")
        if len(self.vehicles) < FEWEST:
            line += f"; not compared, which takes {FEWEST}"
        else:
            line += f", {count} {'differs' if count == 1 else 'differ'} from the fleet"
        return Shown(line, ("vehicle", "drives", *head), rows)


def units_of(machine: Machine) -> dict[str, str]:
    """Property → unit: states that a machine keeps while it stands, and its wear per energy."""
    kept = {s.name: s.unit for s in machine.states if s.carried and not s.parked_noise}
    if machine.wear is not None:
        kept.pop(machine.wear.rate_state, None)
        if machine.wear.rate_state:
            kept[WEAR_RATE] = f"{machine.wear.unit}/MJ"
    return kept


@checked
def analyse_fleet(
    places: str | Path | Sequence[str | Path],
    vehicle: Vehicle | str | Path,
    out: str | Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    trust: bool = False,
    rate: float = 10.0,
    progress: Progress | None = None,
) -> Fleet:
    """Estimate over all logs in ``places`` (folders, patterns, files) of vehicles of one kind.

    The logs of a vehicle are taken in order of time, each from the state that the one before has
    left; vehicles are processed at once, by ``workers`` processes of this machine (one for each
    core unless given) or by the Dask cluster whose ``scheduler`` has that address; its workers
    must see the same files.  What is done already in ``out`` is not done again.  Raises
    ClutchestError where there is no log, or none that can be used.
    """
    required("distributed")
    car = load_vehicle(vehicle, trust=trust)
    folder = as_written(out).resolve()
    logs = logs_of([places] if isinstance(places, str | Path) else places, folder)
    made_by = f"{__version__} {car.hash} {rate} {vehicle_text(car, car.path)}"
    with client_of(scheduler, workers) as client:
        chains = _chains(client, logs, car)
        tasks = {
            name: _tasks(chain, made_by, LogTask(chain[0], "", car, folder, rate))
            for name, chain in chains.items()
        }
        _run(client, tasks, progress or silent)
    vehicles = tuple(_vehicle_of(name, some, car) for name, some in tasks.items())
    if not any(one.drives for one in vehicles):
        log, why = next((log, why) for one in vehicles for log, why in one.rejected.items())
        raise ClutchestError(f"no log could be used; the first, {log}: {why}")
    return Fleet(car, vehicles, compared(vehicles, list(units_of(car.machine))))


def compared(
    vehicles: Sequence[FleetVehicle], names: Sequence[str]
) -> dict[str, tuple[FleetComparison, np.ndarray]]:
    """Every property that some vehicle has, compared between them."""
    known = [name for name in names if any(name in one.properties for one in vehicles)]
    missing = (np.nan, np.nan)
    numbers = {
        name: np.array([one.properties.get(name, missing) for one in vehicles]).T for name in known
    }
    tests = max(sum(int(np.isfinite(y).sum()) for y, _ in numbers.values()), 1)
    return {name: outliers(y, std, tests) for name, (y, std) in numbers.items()}


def _chains(
    client: Client, logs: Sequence[FleetLog], vehicle: Vehicle
) -> dict[str, list[FleetLog]]:
    """The logs of every vehicle in order of time; those without absolute times last, by name."""
    paths = [log.path.resolve() for log in logs]
    futures = client.map(begin_of, paths, vehicle=vehicle, pure=False)
    for _ in in_turn(client, futures):
        pass
    begins = [
        survived(future, partial(alone, client, begin_of, path, vehicle))
        for future, path in zip(futures, paths, strict=True)
    ]
    chains: dict[str, list[FleetLog]] = {}
    order = sorted(
        zip(begins, logs, strict=True),
        key=lambda pair: (pair[1].vehicle, pair[0] is None, pair[0] or 0, numbered(pair[1].path)),
    )
    for _, log in order:
        chains.setdefault(log.vehicle, []).append(log)
    return chains


def _tasks(chain: Sequence[FleetLog], made_by: str, like: LogTask) -> list[LogTask]:
    """The tasks of a vehicle's logs, each under a key that depends on those before."""
    tasks: list[LogTask] = []
    for log in chain:
        key = log.key(f"{made_by} {tasks[-1].key if tasks else ''}")
        absolute = FleetLog(log.path.resolve(), log.vehicle)
        tasks.append(LogTask(absolute, key, like.vehicle, like.out, like.rate))
    return tasks


def _run(client: Client, chains: Mapping[str, Sequence[LogTask]], progress: Progress) -> None:
    """Do what is not done.  A log whose workers were lost again and again is left out."""
    while not _all_done(client, chains, progress):
        for chain in chains.values():
            passed = Passed()
            for task in chain:
                if (row := read_row(task.row)) is None:
                    alone(client, estimate_log, task, passed)
                    if read_row(task.row) is None:
                        reject(task, LOST, passed)
                    break
                passed = passed.after(row)
        settle(client)


def _all_done(client: Client, chains: Mapping[str, Sequence[LogTask]], progress: Progress) -> bool:
    """Whether all could be done that was not; else, what a log and those behind it lost workers
    to is not."""
    futures: list[Future] = []
    for chain in chains.values():
        passed: Any = Passed()  # or the future of one
        for task in chain:
            if (row := read_row(task.row)) is not None:
                passed = passed.after(row)
            else:
                passed = client.submit(estimate_log, task, passed, pure=False)
                futures.append(passed)
    whole = True
    for done, future in enumerate(in_turn(client, futures), 1):
        whole &= survived(future, lambda: LOST) != LOST
        progress(f"{done} of {len(futures)} logs", done / len(futures))
    return whole


def _vehicle_of(name: str, tasks: Sequence[LogTask], car: Vehicle) -> FleetVehicle:
    """What the rows of a vehicle's logs say together."""
    rows = [row for row in (read_row(task.row) for task in tasks) if row is not None]
    used = [row for row in rows if row["error"] is None]
    drives = tuple({"log": row["log"], **drive} for row in used for drive in row["drives"])
    wear = next((row["wear"] for row in reversed(used) if row["wear"]), None)
    properties = {}
    for key in units_of(car.machine):
        state = drives[-1]["states"].get(key) if drives else None
        if state is not None and state["valid"]:
            properties[key] = (state["value"], state["std"])
    if wear is not None:
        rate: Mapping[str, Any] = wear["rate"]
        properties[WEAR_RATE] = (rate["value"], rate["std"])
    return FleetVehicle(
        name,
        tuple(row["log"] for row in used),
        {row["log"]: row["error"] for row in rows if row["error"] is not None},
        drives,
        properties,
        wear,
        {row["log"]: note for row in used if (note := note_of(row))},
    )


def note_of(row: Mapping[str, Any]) -> str | None:
    """Why the clock of a log is not relied on, by its row; None where it is."""
    if row.get("note"):
        return str(row["note"])
    days = [drive["day"] for drive in row["drives"] if drive["begin"]]
    if days and min(days) < FIRST_DAY:
        return f"begins on {min(days)}, as after a loss of power: its clock is not relied on"
    return None
