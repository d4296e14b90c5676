"""Series and lanes of a recording: thinned, and strung together over several drives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from clutchest import memory_mapped
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
    widest = int(np.max(np.diff(edges)))
    together = max(memory_mapped.PORTION // widest, 1)
    rows = []
    for first in range(0, pairs, together):
        rows.append(_extremes(values, edges[first : first + together + 1], widest))
        memory_mapped.release_memory()
    return np.concatenate(rows)


def _extremes(values: Floats, edges: NDArray[np.intp], widest: int) -> NDArray[np.intp]:
    """The rows of the lowest and highest value between each two ``edges``."""
    # Stretches differ by one sample; the short ones see their last sample twice.
    rows = edges[:-1, None] + np.arange(widest)
    rows = np.minimum(rows, edges[1:, None] - 1)
    stretches = values[rows]
    low = np.argmin(np.where(np.isnan(stretches), np.inf, stretches), axis=1, keepdims=True)
    high = np.argmax(np.where(np.isnan(stretches), -np.inf, stretches), axis=1, keepdims=True)
    ends = np.sort(np.take_along_axis(rows, np.hstack([low, high]), axis=1), axis=1)
    return ends[np.column_stack([np.ones(len(ends), bool), ends[:, 0] < ends[:, 1]])]


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
