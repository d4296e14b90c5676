"""Apache Parquet; every column's unit in the metadata of its field, as ``unit``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
