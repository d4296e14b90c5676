"""Series and lanes of a recording: thinned, and strung together over several drives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from clutchest import memory_mapped
from clutchest.native import compiled
from clutchest.record.blueprint import COLOURS
from clutchest.signals import Floats

TIMELINE = "time"
BETWEEN = "between drives"
_MOST_ROWS = 50_000  # per series and drive: 25 times the pixels of a wide screen


def outline(values: Floats, most: int) -> NDArray[np.intp]:
    """Rows, ascending, of at most ``most`` samples, two at least: the lowest and highest of equal
    stretches."""
    n, pairs = len(values), max(most // 2, 1)
    if n <= most:
        return np.arange(n)
    edges = np.linspace(0, n, pairs + 1).astype(np.intp)
    together = max(memory_mapped.PORTION * pairs // n, 1)
    rows, count = np.empty(2 * pairs, np.intp), 0
    for first in range(0, pairs, together):
        count += _extremes(values, edges[first : first + together + 1], rows[count:])
        memory_mapped.release_memory()
    return rows[:count]


@compiled
def _extremes(values, edges, rows):  # type: ignore[no-untyped-def]
    """Fills ``rows`` with those of the lowest and highest value between each two ``edges``, one row
    where they are the same; returns how many there are."""
    count = 0
    for k in range(len(edges) - 1):
        low = high = edges[k]
        for i in range(edges[k], edges[k + 1]):
            value = values[i]
            if value < values[low] or (values[low] != values[low] and value == value):
                low = i
            if value > values[high] or (values[high] != values[high] and value == value):
                high = i
        rows[count] = min(low, high)
        count += 1
        if low != high:
            rows[count] = max(low, high)
            count += 1
    return count


def one_behind_another(lengths: Sequence[float]) -> tuple[list[float], float]:
    """Where drives of these ``lengths`` begin on the timeline, and where the last one ends, s."""
    apart = 0.02 * sum(lengths)
    starts = [float(s) for s in np.cumsum([0.0, *(length + apart for length in lengths)])]
    return starts[:-1], starts[-1] - apart


def strung(drives: Iterable[tuple[float, Sequence[NDArray]]]) -> list[NDArray]:
    """Columns (time first, values next, then others) of all drives, one behind another.

    ``drives``: where each begins on the timeline, and its columns.  Each is thinned by its
    values; a row without a value before each later drive breaks the line.
    """
    joined: list[list[NDArray]] = []
    for start, columns in drives:
        rows = outline(columns[1], _MOST_ROWS)
        if len(rows) == 0:
            continue
        cut = [column[rows] for column in columns]
        cut[0] = cut[0] + start
        if joined:
            gap = [column[:1].copy() for column in cut]
            gap[1][:] = np.nan
            cut = [np.concatenate(pair) for pair in zip(gap, cut, strict=True)]
        joined.append(cut)
    return [np.concatenate(pieces) for pieces in zip(*joined, strict=True)]


def index(time: Floats) -> list[rr.TimeColumn]:
    """``time`` (s) as the column that places rows on the timeline."""
    nanoseconds = np.round(time * 1e9).astype(np.int64).astype("timedelta64[ns]")
    return [rr.TimeColumn(TIMELINE, duration=nanoseconds)]


def send_lane(
    stream: rr.RecordingStream,
    entity: str,
    changes: Sequence[tuple[float, str]],
    fixed: dict[str, int],
) -> None:
    """A lane of words over time: ``changes`` (time, word), colours ``fixed`` for some words."""
    values = list(dict.fromkeys(value for _, value in changes))
    colours = [fixed.get(value, COLOURS[k % len(COLOURS)]) for k, value in enumerate(values)]
    stream.log(
        entity,
        rr.StateConfiguration(
            values=values,
            colors=np.array(colours, np.uint32),
            visible=[value != BETWEEN for value in values],
        ),
        static=True,
    )
    stream.send_columns(
        entity,
        index(np.array([time for time, _ in changes])),
        rr.StateChange.columns(state=[value for _, value in changes]),
    )
