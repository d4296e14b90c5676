"""Trouble codes: debounce, status byte, suspect parameter number and failure mode.

Status bits as ISO 14229-1 numbers them; SPN and FMI as in SAE J1939-73.  A fault has a number in
J1939's proprietary range unless the vehicle file gives it another one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from zlib import crc32

from clutchest.diagnosis.faults import Alarm, kinds
from clutchest.errors import nearest
from clutchest.vehicle import Vehicle
from clutchest.vehicle.toml import error_in

PROPRIETARY = range(520_192, 524_288)  # SPNs for manufacturers' own use
CLUTCH = PROPRIETARY[0]  # the machine as a whole: a set of faults that cannot be isolated
UNKNOWN_CAUSE = 11  # FMI
MISFIT = "misfit"  # deviations that no known fault explains
WEAR = "wear"  # beyond its limit
WORN = 16  # FMI: above normal, moderately severe
CONTRADICTION = "contradiction"  # of signals and model
INCORRECT = 2  # FMI: data erratic, intermittent or incorrect
KINDS = (
    "missing",
    "late",
    "frozen",
    "counter",
    "checksum",
    "stuck",
    "noise",
    "drift",
    "implausible",
    "sticking",
)
BLOCK = 371  # numbers per kind, and for the faults of the equations
TICK_S = 0.1  # s between two reports of a test to its debounce counter
FAILED, PASSED = 127, -128  # of the counter
UP, DOWN = 127, -1  # a sequential test fails at once and passes after 25.5 s

TEST_FAILED, FAILED_THIS_CYCLE, PENDING, CONFIRMED = 1, 2, 4, 8
NOT_COMPLETED_SINCE_CLEAR, FAILED_SINCE_CLEAR, NOT_COMPLETED_THIS_CYCLE = 16, 32, 64


@dataclass(slots=True)
class Debounce:
    """The counter of one code and the status byte that follows from it."""

    counter: int = 0
    status: int = NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE

    def report(self, failed: bool) -> None:
        """One result of the test, every ``TICK_S`` s."""
        if failed:
            self.counter = min(max(self.counter, 0) + UP, FAILED)
        else:
            self.counter = max(self.counter + DOWN, PASSED)
        if self.counter == FAILED:
            self.status |= (
                TEST_FAILED | FAILED_THIS_CYCLE | PENDING | CONFIRMED | FAILED_SINCE_CLEAR
            )
        elif self.counter == PASSED:
            self.status &= ~TEST_FAILED
        if self.counter in (FAILED, PASSED):
            self.status &= ~(NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE)

    def next_cycle(self) -> None:
        """A new drive begins: a test that did not fail in the last one is no longer pending."""
        if not self.status & (FAILED_THIS_CYCLE | NOT_COMPLETED_THIS_CYCLE):
            self.status &= ~PENDING
        self.status = self.status & ~FAILED_THIS_CYCLE | NOT_COMPLETED_THIS_CYCLE
        self.counter = 0


def status_byte(drives: Sequence[tuple[float, Sequence[Alarm]]]) -> int:
    """The status byte after drives, each given by its length in s and the alarms of one test."""
    code = Debounce()
    for number, (length, alarms) in enumerate(drives):
        if number:
            code.next_cycle()
        for tick in range(1, int(length / TICK_S) + 1):
            now = tick * TICK_S
            code.report(
                any(a.detected <= now and (a.ended is None or now < a.ended) for a in alarms)
            )
        if any(a.detected > int(length / TICK_S) * TICK_S for a in alarms):
            code.report(True)
    return code.status


def check_codes(vehicle: Vehicle, tests: Iterable[str]) -> None:
    """Raises ClutchestError for a code of the vehicle file of a fault that is none of the
    ``tests`` of this vehicle, nor of any that a vehicle of its machine may have."""
    known = {*tests, *(fault.name for fault in vehicle.machine.faults), WEAR, MISFIT, "clutch"}
    known |= {f"{kind.kind}:{name}" for kind in kinds() for name in vehicle.machine.units}
    free = (CONTRADICTION, "silent")  # of any sensor, of any channel
    for fault in vehicle.codes:
        if fault not in known and fault.split(":")[0] not in free:
            keys = ("monitors", "codes", fault)
            words = f"monitors.codes: no fault '{fault}'{nearest(fault, known)}"
            raise error_in(vehicle.path, keys, words)


def number_of(fault: str, vehicle: Vehicle, size: float = 0.0) -> tuple[int, int]:
    """(SPN, FMI) of one fault; the sign of ``size`` selects the failure mode."""
    stated = vehicle.codes.get(fault)
    kind = fault.split(":")[0]
    fmi = UNKNOWN_CAUSE
    for stream in kinds():
        if stream.kind == kind:
            fmi = stream.fmi
    for of_model in vehicle.machine.faults:
        if of_model.name == fault:
            fmi = of_model.fmi[0 if size >= 0.0 else 1]
    if fault == WEAR:
        fmi = WORN
    if kind == CONTRADICTION:
        fmi = INCORRECT
    if stated is not None:
        return stated[0], fmi if stated[1] is None else stated[1]
    return PROPRIETARY[_place(fault)], fmi


def _place(fault: str) -> int:
    """A number per fault: the block of its kind, and the place of its subject in it.

    Both depend on names alone, so that they stay when faults and signals are added.
    """
    kind, _, subject = fault.partition(":")
    block = KINDS.index(kind) if kind in KINDS else len(KINDS)
    return 1 + block * BLOCK + crc32((subject or kind).encode()) % BLOCK


def number_of_set(faults: Sequence[str], vehicle: Vehicle, size: float = 0.0) -> tuple[int, int]:
    """(SPN, FMI) of a fault, or of a set of which none is excluded: then no component's."""
    if len(faults) == 1 and faults[0] != MISFIT:
        return number_of(faults[0], vehicle, size)
    stated = vehicle.codes.get("clutch")
    return (stated[0] if stated else CLUTCH), UNKNOWN_CAUSE
