"""The result of a diagnosis: every monitor, every fault, and which faults can be isolated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from clutchest.checked import checked
from clutchest.diagnosis.structure import AffectedSensor
from clutchest.shown import Shown, Tabulated, plain
from clutchest.signals import Floats

if TYPE_CHECKING:
    from clutchest.diagnosis.isolation import Explanation
    from clutchest.estimate.run import Run
    from clutchest.pictures import Picture


_COLOURS = {"passed": "tab:green", "failed": "tab:red", "not run": "0.9"}
STATUSES = ("failed", "passed", "not run")  # of a monitor, the worst first


@dataclass(frozen=True, slots=True)
class MonitorStatus:
    """One monitor: ``status`` is ``passed``, ``failed`` or ``not run``; ``why`` says what was
    tested with which result, or why the test could not run; ``drives`` holds each one's status."""

    name: str
    status: str
    why: str
    threshold: float | None
    false_alarms_per_1000h: float
    drives: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: ``set`` all that the data do not exclude, the most probable, ``fault``, first.

    ``first_detected_s`` and ``began_s`` on the clock of ``drive``, ``ended_s`` where it healed;
    ``confidence``: 1 − p, where p is the probability of such an alarm in a healthy vehicle.
    ``freeze_frame``: mode, states, inputs and ranked causes at detection.
    """

    fault: str
    set: tuple[str, ...]
    drive: int
    began_s: float
    first_detected_s: float
    ended_s: float | None
    confidence: float
    what: str
    causes: tuple[Explanation, ...]
    freeze_frame: Mapping[str, Any]
    status_byte: int
    spn: int
    fmi: int

    def summary(self) -> dict[str, Any]:
        """As ``diagnosis.json`` holds it."""
        return {
            "fault": self.fault,
            "set": list(self.set),
            "drive": self.drive,
            "first_detected_s": self.first_detected_s,
            "began_s": self.began_s,
            "ended_s": self.ended_s,
            "confidence": self.confidence,
            "what": self.what,
            "causes": [_of_cause(cause) for cause in self.causes],
            "freeze_frame": self.freeze_frame,
            "status_byte": self.status_byte,
            "spn": self.spn,
            "fmi": self.fmi,
        }


def _of_cause(cause: Explanation) -> dict[str, Any]:
    """As ``diagnosis.json`` holds it: no size where none is determined, but why."""
    known = cause.determined
    return {
        "fault": cause.fault,
        "size": cause.size if known else None,
        "std": cause.std if known else None,
        "unit": cause.unit,
        "behind": cause.behind,
        "size_not_determined": cause.why_not or None,
    }


@dataclass(frozen=True, slots=True)
class Isolability:
    """Which faults a drive can detect and isolate.

    ``structure``: fault → the sensors that it affects, and through which states.  ``d_prime``
    (H, H + 1): separability of each fault, with one of ``sizes`` (H), from every other and, last
    column, from no fault, in standard deviations; ``detectable`` (H) sizes, None where no plausible
    one is.
    """

    faults: tuple[str, ...]
    units: tuple[str, ...]
    sizes: Floats
    d_prime: Floats
    detectable: tuple[float | None, ...]
    structure: Mapping[str, tuple[AffectedSensor, ...]]

    def summary(self) -> dict[str, Any]:
        """As ``diagnosis.json`` holds it."""
        return {
            "faults": list(self.faults),
            "units": list(self.units),
            "sizes": self.sizes,
            "d_prime": self.d_prime[:, :-1],
            "d_prime_none": self.d_prime[:, -1],
            "detectable_size": list(self.detectable),
            "structure": {fault: [*map(str, sensors)] for fault, sensors in self.structure.items()},
        }


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Diagnosis(Tabulated):
    """The diagnosis of one run; ``lanes``: monitor → (time s, status) per drive."""

    run: Run
    monitors: tuple[MonitorStatus, ...]
    faults: tuple[Fault, ...]
    isolability: Isolability | None
    provenance: Mapping[str, str]
    lanes: Mapping[str, tuple[tuple[tuple[float, str], ...], ...]] = field(default_factory=dict)

    @property
    def by_name(self) -> Mapping[str, MonitorStatus]:
        """The monitors."""
        return {monitor.name: monitor for monitor in self.monitors}

    def shown(self) -> Shown:
        """Every fault, and every monitor with its status."""
        names = ", ".join(fault.fault for fault in self.faults) or "no fault"
        ran = sum(m.status != "not run" for m in self.monitors)
        rows = [(f.fault, "fault", f.what) for f in self.faults]
        ranked = sorted(self.monitors, key=lambda monitor: STATUSES.index(monitor.status))
        rows += [(m.name, m.status, m.why) for m in ranked]
        line = f"{names}; {ran} of {len(self.monitors)} monitors ran"
        return Shown(line, ("name", "status", "why"), rows)

    def rows(self) -> list[dict[str, Any]]:
        """A row a monitor; of what it found, when that began and was detected, and how sure."""
        found = {fault.fault: fault for fault in self.faults}
        return [
            {
                "monitor": m.name,
                "status": m.status,
                "why": m.why,
                "threshold": m.threshold,
                "false_alarms_per_1000h": m.false_alarms_per_1000h,
                "began_s": found[m.name].began_s if m.name in found else None,
                "first_detected_s": found[m.name].first_detected_s if m.name in found else None,
                "confidence": found[m.name].confidence if m.name in found else None,
            }
            for m in self.monitors
        ]

    def column_units(self) -> dict[str, str]:
        """Column of the rows → unit."""
        return {"began_s": "s", "first_detected_s": "s"}

    @checked
    def plot(self, drive: int = 0) -> Picture:
        """When each monitor of one drive passed (green) and failed (red)."""
        from clutchest.pictures import stacked

        track = self.run.track(drive)
        names = [name for name, drives in self.lanes.items() if drives[drive]]
        figure, (axes,) = stacked(1, 0.25 * len(names) + 0.5)
        end = float(track.time[-1])
        for row, name in enumerate(names):
            lane = self.lanes[name][drive]
            until = [*(time for time, _ in lane[1:]), end]
            for (begin, status), stop in zip(lane, until, strict=True):
                axes.barh(row, stop - begin, left=begin, height=0.8, color=_COLOURS.get(status))
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.4, -0.6)
        return figure

    @property
    def warnings(self) -> list[str]:
        """What its machine says is to be kept in mind of a diagnosis, and what the log lacks."""
        reserved = self.run.vehicle.machine.reserved("diagnose")
        return [*reserved, *map(str, self.run.summary["warnings"])]

    def summary(self) -> dict[str, Any]:
        """As ``diagnosis.json`` holds it."""
        contents = {
            "warnings": self.warnings,
            "monitors": [
                {
                    "name": m.name,
                    "status": m.status,
                    "why": m.why,
                    "threshold": m.threshold,
                    "false_alarms_per_1000h": m.false_alarms_per_1000h,
                    "drives": list(m.drives),
                }
                for m in self.monitors
            ],
            "faults": [fault.summary() for fault in self.faults],
            "isolability": self.isolability.summary() if self.isolability else None,
            "provenance": dict(self.provenance),
        }
        return dict(plain(contents))
