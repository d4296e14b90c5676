"""Apache Parquet; every column's unit in the metadata of its field, as ``unit``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchest import budgets
from clutchest.errors import ClutchestError
from clutchest.paths import named_in_utf8
from clutchest.reading.signal_table import Frame, NumberTable, of_frame, stated_unit
from clutchest.reading.table_budget import check_cells
from clutchest.reading.table_kind import TableKind
from clutchest.signals import Floats

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


def read(path: Path) -> Frame | NumberTable:
    """The table, with the units in the metadata of its fields; lists, structs, bytes and times of a
    day, which are no signals, are left out.

    Raises ClutchestError for a table beyond its budget.
    """
    import pyarrow.parquet as pq

    with named_in_utf8(path) as file:
        schema = pq.read_schema(file)
        if b"clutchest" in (schema.metadata or {}):
            raise ClutchestError(f"{path}: is a result of clutchest, expected a log")
        kept = [column for column in schema if _may_be_signal(column.type)]
        about = pq.read_metadata(file)
        check_cells(path, about.num_rows * len(kept))
        units = {column.name: stated_unit(column) for column in kept}
        if len(units) == len(kept) and all(map(_is_plain, kept)) and not _index(schema):
            return NumberTable(
                str(path), units, about.num_rows, partial(_column, path, about.num_rows)
            )
        words = [column.name for column in kept if _is_text(column.type)]
        names = [column.name for column in kept]
        with pq.ParquetFile(file, read_dictionary=words) as given:
            table = given.read(names)
    for name in dict.fromkeys(words):
        _check_words(path, table, name)
    table = table.cast(_plain(table.schema))
    frame = table.to_pandas(split_blocks=True, self_destruct=True)
    return of_frame(str(path), frame, units)


def _is_plain(column: pa.Field) -> bool:
    """Whether a column holds numbers, and needs nothing of what pandas knows of tables."""
    import pyarrow.types as is_a

    kind = column.type
    return (is_a.is_floating(kind) or is_a.is_integer(kind)) and column.name == column.name.strip()


def _index(schema: pa.Schema) -> list[Any]:
    """What pandas has noted of the table's index, where it is more than the rows' numbers."""
    noted = json.loads((schema.metadata or {}).get(b"pandas", b"{}")).get("index_columns", [])
    return [index for index in noted if not isinstance(index, dict) or index.get("name")]


def _column(path: Path, rows: int, name: str) -> Floats:
    """A column of numbers (rows,), NaN where there is none.

    One at a time and by Arrow's buffers: a table as a whole takes four times as long, for its
    memory, and pandas half as long again.  Raises ClutchestError where it is damaged.
    """
    import pyarrow.parquet as pq

    parts = []
    try:
        with named_in_utf8(path) as file, pq.ParquetFile(file) as given:
            for chunk in given.read([name], use_threads=False).column(0).chunks:
                known, data = chunk.buffers()
                own = slice(chunk.offset, chunk.offset + len(chunk))
                values = np.frombuffer(data, chunk.type.to_pandas_dtype())[own]
                if known is not None:
                    bits = np.unpackbits(np.frombuffer(known, np.uint8), bitorder="little")
                    values = np.where(bits[own], values, np.nan)
                parts.append(values.astype(np.float64, copy=False))
    except Exception as problem:  # as load_table has it
        words = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
        raise ClutchestError(f"{path}: not a readable table: {words}") from None
    if (read := sum(map(len, parts))) != rows:
        raise ClutchestError(
            f"{path}: not a readable table: {read} values in column '{name}', expected {rows}"
        )
    if len(parts) == 1 and parts[0].flags.owndata:  # not a view of the file's
        return parts[0]
    return np.concatenate(parts) if parts else np.zeros(0)


def _may_be_signal(kind: pa.DataType) -> bool:
    import pyarrow.types as is_a

    return not (
        is_a.is_nested(kind)
        or is_a.is_time(kind)
        or is_a.is_binary(kind)
        or is_a.is_large_binary(kind)
        or is_a.is_fixed_size_binary(kind)
    )


def _is_text(kind: pa.DataType) -> bool:
    import pyarrow.types as is_a

    return bool(is_a.is_string(kind) or is_a.is_large_string(kind) or is_a.is_string_view(kind))


def _check_words(path: Path, table: pa.Table, name: str) -> None:
    """Raises ClutchestError for a column of texts that a dictionary keeps small, and pandas would
    not."""
    import pyarrow.compute as pc

    bytes_ = 0
    for column in (
        c for c, field in zip(table.columns, table.schema, strict=True) if field.name == name
    ):
        for chunk in column.chunks:
            of_each = pc.binary_length(chunk.dictionary)
            bytes_ += pc.sum(of_each.take(chunk.indices)).as_py() or 0
    if bytes_ > budgets.TABLE_WORDS:
        raise ClutchestError(
            f"{path}: column '{name}' holds {bytes_ >> 20} MiB of text, expected at most "
            f"{budgets.TABLE_WORDS >> 20}"
        )


def _plain(schema: pa.Schema) -> pa.Schema:
    """The schema with texts and numbers of kinds that pandas has."""
    import pyarrow as pa

    def plain(kind: pa.DataType) -> pa.DataType:
        if pa.types.is_dictionary(kind):
            return kind.value_type
        return pa.float64() if pa.types.is_decimal(kind) else kind

    return pa.schema([f.with_type(plain(f.type)) for f in schema], schema.metadata)


FORMAT = TableKind(
    about="Apache Parquet",
    suffixes=(".parquet",),
    marks=(b"PAR1",),
    read=read,
    write=write,
)
