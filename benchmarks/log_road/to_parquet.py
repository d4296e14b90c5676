"""A log of any size to Parquet, a file per message, a block of the log in memory at a time.

python benchmarks/log_road/to_parquet.py LOG DBC FOLDER
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from clutchest import can

ROWS = 200_000  # of a message, that are written together


def convert(log: Path, dbc: Path, folder: Path) -> None:
    """Every message of ``log`` that ``dbc`` knows, as FOLDER/<message>.parquet."""
    folder.mkdir(parents=True, exist_ok=True)
    database = can.load_database([dbc])
    writers: dict[str, pq.ParquetWriter] = {}
    waiting: dict[str, list[pa.Table]] = {}
    with ExitStack() as files:

        def write(name: str) -> None:
            table = pa.concat_tables(waiting.pop(name))
            if name not in writers:
                path = folder / f"{name}.parquet"
                writers[name] = files.enter_context(pq.ParquetWriter(path, table.schema))
            writers[name].write_table(table)

        for frames in can.read_blocks(log):
            for name, table in frames.decode(database).items():
                waiting.setdefault(name, []).append(table)
                if sum(part.num_rows for part in waiting[name]) >= ROWS:
                    write(name)
        for name in list(waiting):
            write(name)


if __name__ == "__main__":
    convert(*map(Path, sys.argv[1:4]))
