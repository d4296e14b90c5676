"""Apache Parquet; every column's unit in the metadata of its field, as ``unit``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clutchest.errors import ClutchestError
from clutchest.paths import named_in_utf8
from clutchest.reading.signal_table import Frame, of_frame
from clutchest.reading.table_budget import check_cells
from clutchest.reading.table_kind import TableKind

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    whole = pa.Table.from_pandas(table, preserve_index=False)
    pq.write_table(whole.cast(with_units(whole.schema, table.attrs.get("units", {}))), path)


def with_units(schema: pa.Schema, units: Mapping[str, str]) -> Any:
    """The schema with every column's unit."""
    import pyarrow as pa

    fields = [
        field.with_metadata({"unit": units[field.name]}) if field.name in units else field
        for field in schema
    ]
    return pa.schema(fields, schema.metadata)


def read(path: Path) -> Frame:
    """The table, with the units in the metadata of its fields."""
    import pandas as pd
    import pyarrow.parquet as pq

    with named_in_utf8(path) as file:
        schema = pq.read_schema(file)
        if b"clutchest" in (schema.metadata or {}):
            raise ClutchestError(f"{path}: is a result of clutchest, expected a log")
        about = pq.read_metadata(file)
        check_cells(path, about.num_rows * about.num_columns)
        frame = pd.read_parquet(file)
    stated = {}
    for column in schema:
        metadata = column.metadata or {}
        unit = next((metadata[k] for k in (b"unit", b"units", b"Unit") if k in metadata), b"")
        stated[column.name] = unit.decode("utf-8", "replace")
    return of_frame(str(path), frame, stated)


FORMAT = TableKind(
    about="Apache Parquet",
    suffixes=(".parquet",),
    marks=(b"PAR1",),
    read=read,
    write=write,
)
