"""The benches of a simulated log, as ``simulate`` writes them beside it."""

from __future__ import annotations

import json
from pathlib import Path

from clutchest.models.experiments import BenchSection
from clutchest.paths import named_in_utf8
from clutchest.signals import Signals


def stated_benches(drive: Signals) -> tuple[BenchSection, ...]:
    """Those of a drive from one log with its truth beside it; none of any other drive."""
    if len(drive.sources) != 1:
        return ()
    truth = Path(drive.sources[0] + ".truth.parquet")
    if not truth.is_file():
        return ()
    import pyarrow.parquet as pq

    try:
        with named_in_utf8(truth) as file:
            metadata = pq.read_schema(file).metadata or {}
        stated = json.loads(metadata.get(b"benches", b"[]"))
        return tuple(BenchSection(float(a), float(b), str(name)) for a, b, name in stated)
    except (OSError, ValueError, TypeError):
        return ()
