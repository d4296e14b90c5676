"""MCAP, as robotics' viewers read it: one message in JSON for every row, with a schema.

The topic is ``clutchest``.  A message has the columns that have a value in its row; units and
comments stand in the schema and in the channel's metadata.  Where the start of a drive is not
known its time counts from 1970.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest.extras import required
from clutchest.reading.drives_in_table import drives_of
from clutchest.reading.table_kind import TableKind

if TYPE_CHECKING:
    import pandas as pd

TOPIC = "clutchest"


def write(table: pd.DataFrame, path: Path) -> None:
    """Write ``table``."""
    required("mcap")
    from mcap.writer import Writer

    units = {str(k): str(v) for k, v in table.attrs.get("units", {}).items()}
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(library="clutchest")
        schema = json.dumps(_schema(table), ensure_ascii=False).encode()
        known = writer.register_schema(TOPIC, "jsonschema", schema)
        channel = writer.register_channel(TOPIC, "json", known, {"units": json.dumps(units)})
        for rows, start in drives_of(table):
            stamps = np.round(rows["time"].to_numpy(np.float64) * 1e9).astype(np.int64)
            for stamp, message in zip(
                (stamps + (start or 0)).tolist(), _messages(rows), strict=True
            ):
                at = max(stamp, 0)
                writer.add_message(channel, at, message, at)
        writer.finish()


def _schema(table: pd.DataFrame) -> dict[str, Any]:
    import pandas as pd

    units, comments = table.attrs.get("units", {}), table.attrs.get("comments", {})
    properties = {}
    for name, kind in table.dtypes.items():
        of = "string"
        if pd.api.types.is_bool_dtype(kind):
            of = "boolean"
        elif pd.api.types.is_numeric_dtype(kind):
            of = "number"
        words = f"{comments.get(name, '')} [{units[name]}]" if name in units else comments.get(name)
        properties[str(name)] = {"type": of, **({"description": words.strip()} if words else {})}
    return {"type": "object", "properties": properties}


def _messages(rows: pd.DataFrame) -> list[bytes]:
    """Every row as JSON, without what is empty."""
    lines = rows.to_json(
        orient="records", lines=True, date_format="iso", date_unit="ns", double_precision=15
    )
    given = rows.notna().to_numpy().all()
    if given:
        return [line.encode() for line in lines.splitlines()]
    parts = (json.loads(line) for line in lines.splitlines())
    return [
        json.dumps({k: v for k, v in part.items() if v is not None}, ensure_ascii=False).encode()
        for part in parts
    ]


FORMAT = TableKind(
    about="MCAP of robotics: a message in JSON for every row",
    suffixes=(".mcap",),
    write=write,
    extra="mcap",
)
