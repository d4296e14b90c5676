"""All signals in frames, as tables: what ``Frames.decode`` gives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clutchest.can.database import Database, DatabaseFile, Message, load
from clutchest.can.decode import DecodedColumn, decode, rows_of
from clutchest.can.frames import Frames
from clutchest.can.transport import reassembled
from clutchest.errors import ClutchestError, UnknownNameError, nearest
from clutchest.signals import Why

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Files = str | Path | Sequence[str | Path]
Databases = Database | Files | Mapping[int, Files]


@dataclass(frozen=True, repr=False, eq=False)
class DecodedFrames(Mapping[str, "pa.Table"]):
    """The messages that occur in ``frames``: name → Arrow table with ``time``, ``channel``, ``id``
    and a column per signal, one row per frame.

    ``time`` is a timestamp in UTC (ns), a duration where the log only counts from its start.  A
    signal that is not valid, or that a multiplexer leaves out, is null.  :meth:`to_arrow`,
    :meth:`to_pandas` and :meth:`to_polars` give all of them in one table, one row per reading.
    """

    frames: Frames
    database: Database
    rows: Mapping[str, NDArray[np.intp]]

    @classmethod
    def of(
        cls, frames: Frames, database: Databases, messages: Sequence[str] | None = None
    ) -> DecodedFrames:
        """Of ``messages``, all unless given; a dictionary has the databases of each channel.

        Raises ClutchestError for an unknown message, and for a database that cannot be read.
        """
        known = _loaded(database)
        for name in messages or ():
            if name not in known.messages:
                raise ClutchestError(f"no message '{name}'" + nearest(name, known.messages))
        wanted = [known.message(name) for name in messages or known.messages]
        whole = reassembled(frames.sorted(), wanted)
        rows = {message.name: rows_of(whole, message) for message in wanted}
        return cls(whole, known, {name: found for name, found in rows.items() if len(found)})

    def __getitem__(self, name: str) -> pa.Table:
        import pyarrow as pa

        if name not in self.rows:
            raise UnknownNameError(f"no frame of a message '{name}'{nearest(str(name), self.rows)}")
        message, rows = self.database.message(name), self.rows[name]
        columns: dict[str, Any] = {
            "time": self._times(rows),
            "channel": pa.array(self.frames.channel[rows]),
            "id": pa.array(self.frames.id[rows]),
        }
        for signal, column in self._columns(message):
            value = np.full(len(rows), np.nan)
            value[np.searchsorted(rows, column.rows)] = column.value
            columns[signal] = pa.array(value, mask=np.isnan(value))
        fields = [
            pa.field(key, array.type, metadata=_unit(message, key))
            for key, array in columns.items()
        ]
        return pa.table(list(columns.values()), schema=pa.schema(fields))

    def __repr__(self) -> str:
        return f"<DecodedFrames: {', '.join(self.rows)}>"

    def __iter__(self) -> Iterator[str]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def to_arrow(self) -> pa.Table:
        """One row per valid reading: ``time``, ``channel``, ``message``, ``signal``, ``value``,
        ``unit``, message by message."""
        import pyarrow as pa

        parts = [
            self._readings(self.database.message(name), signal, column)
            for name in self.rows
            for signal, column in self._columns(self.database.message(name))
        ]
        if not parts:
            names = ("time", "channel", "message", "signal", "value", "unit")
            return pa.table({name: pa.array([], pa.null()) for name in names})
        return pa.concat_tables(parts).unify_dictionaries()

    def to_pandas(self) -> pd.DataFrame:
        """The same as a DataFrame of pandas."""
        return self.to_arrow().to_pandas()

    def to_polars(self) -> Any:
        """The same as a DataFrame of polars, which must be installed."""
        import polars

        return polars.from_arrow(self.to_arrow())

    def _columns(self, message: Message) -> Iterator[tuple[str, DecodedColumn]]:
        narrow = [name for name, layout in message.signals.items() if layout.width <= 64]
        for name in narrow:
            yield name, decode(self.frames, self.rows[message.name], message, [name])[name]

    def _times(self, rows: NDArray[np.intp]) -> pa.Array:
        import pyarrow as pa

        kind = pa.timestamp("ns", "UTC") if self.frames.absolute else pa.duration("ns")
        return pa.array(self.frames.t_ns[rows]).cast(pa.int64()).cast(kind)

    def _readings(self, message: Message, signal: str, column: DecodedColumn) -> pa.Table:
        import pyarrow as pa

        valid = column.why == Why.VALID
        rows = column.rows[valid]
        words = (message.name, signal, message.signal(signal).unit)
        index = np.zeros(len(rows), np.int32)
        named = [pa.DictionaryArray.from_arrays(index, [word]) for word in words]
        return pa.table(
            {
                "time": self._times(rows),
                "channel": self.frames.channel[rows],
                "message": named[0],
                "signal": named[1],
                "value": column.value[valid],
                "unit": named[2],
            }
        )


def _loaded(database: Databases) -> Database:
    if isinstance(database, Database):
        return database
    of_channels = database if isinstance(database, Mapping) else {None: database}
    return load(
        [
            DatabaseFile(Path(path), channel)
            for channel, files in of_channels.items()
            for path in ([files] if isinstance(files, str | Path) else files)
        ]
    )


def _unit(message: Message, name: str) -> dict[str, str] | None:
    layout = message.signals.get(name)
    return {"unit": layout.unit} if layout is not None and layout.unit else None
