"""What is shared among the cores of a machine: whole fits, or the derivatives of a large one.

Compiled kernels and linear algebra let go of the interpreter, so threads serve: nothing is copied,
and results are those of one after another.
"""

from __future__ import annotations

import os

MOST = 4  # threads: beyond, what holds the interpreter decides
ENTRIES = 7e6  # of derivatives that fits may hold together
FEWEST = 8  # derivatives that are worth a thread


def fits_at_once(entries: int) -> int:
    """How many fits may run at the same time that hold so many ``entries`` of derivatives each."""
    return min(_cores(), MOST, max(int(ENTRIES / max(entries, 1)), 1))


def parts_of(derivatives: int, entries: int) -> int:
    """Into how many parts the ``derivatives`` of a fit of so many ``entries`` are divided: of one
    that is too large to run beside others."""
    if 2 * entries <= ENTRIES:
        return 1
    return max(min(_cores(), MOST, derivatives // FEWEST), 1)


def _cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
