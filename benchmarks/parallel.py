"""Tasks of a benchmark on all cores, with progress on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from multiprocessing import Pool
from typing import TypeVar

Task = TypeVar("Task")
Found = TypeVar("Found")


def ran(what: str, of: Callable[[Task], Found], tasks: Sequence[Task], jobs: int) -> list[Found]:
    """``of`` every task in parallel, in the order of the tasks, with progress on stderr."""
    results = []
    with Pool(jobs) as pool:
        for result in pool.imap(of, tasks):
            results.append(result)
            print(f"\r{what}: {len(results)} of {len(tasks)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return results
