"""Whether a drive is of a test bench on which the machine's equations do not hold."""

from __future__ import annotations

from dataclasses import replace

from clutchest.estimate.contradiction import Contradiction
from clutchest.models.experiments import BenchRecord
from clutchest.signals import Signal, Signals
from clutchest.vehicle import Vehicle

SHARE = 1 / 3  # of a drive that is of another bench


def bench_record(drive: Signals, vehicle: Vehicle) -> BenchRecord:
    """A drive as one record whose bench is not known."""
    kept: dict[str, Signal] = {}
    for name in (name for name in drive if name in vehicle.signals):
        valid = drive[name].only_valid()
        if len(valid):
            kept[name] = replace(valid, time=valid.time - vehicle.signals[name].delay)
    return BenchRecord(
        "",
        kept,
        {name: vehicle.signals[name].noise for name in kept},
        {name: vehicle.signals[name].noise_ar for name in kept},
        {key: p.value for key, p in vehicle.parameters.items()},
    )


def on_other_bench(drive: Signals, vehicle: Vehicle) -> Contradiction | None:
    """That much of the drive is of another bench; None of a machine without benches."""
    benches = vehicle.machine.benches
    if benches is None:
        return None
    sections = benches.out_of_place(bench_record(drive, vehicle))
    if sum(s.end - s.start for s in sections) < SHARE * drive.end:
        return None
    longest = max(sections, key=lambda s: s.end - s.start)
    return Contradiction(
        f"from {longest.start:.0f} to {longest.end:.0f} s the signals are those of the bench "
        f"'{longest.bench}'",
        vehicle.machine.equations(drive.available).anchor,
        min(s.start for s in sections),
        f"{benches.names[longest.bench]}, where these equations do not hold; "
        "`clutchest identify` takes such logs",
        "bench",
    )
