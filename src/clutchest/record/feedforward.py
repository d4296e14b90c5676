"""The file of a feedforward."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from clutchest.estimate.feedforward import Feedforward
from clutchest.reading.table_formats import write_table
from clutchest.record.arrow import without_pandas
from clutchest.record.files import finished_into

NAME = "feedforward.parquet"


def write_feedforward(found: Feedforward, out: Path, formats: Sequence[str] = ()) -> list[Path]:
    """Write ``feedforward.parquet`` into the folder ``out``, units in its metadata, with
    ``formats`` (``csv``, ``xlsx``, ``mf4``, ``mcap``) also in these; gives the paths.

    Raises ClutchestError if ``out`` is no folder.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    with without_pandas(), finished_into(out) as folder:
        table = pa.table(dict(found.columns))
        metadata = {
            "vehicle": found.vehicle,
            "units": json.dumps({name: found.units[name] for name in found.columns}),
        }
        pq.write_table(table.replace_schema_metadata(metadata), folder / NAME)
        for suffix in formats:
            write_table(found.to_pandas(), (folder / NAME).with_suffix(f".{suffix}"))
        names = sorted(path.name for path in folder.iterdir())
    return [out / name for name in names]
