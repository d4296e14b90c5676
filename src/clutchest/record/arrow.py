"""pyarrow without pandas.

pyarrow and rerun search for pandas whenever they are given an array.  Loading it would make
``clutchest replay demo`` take 1.17 s instead of 1.04 s, 1.13 (1.07 … 1.18) times as long in seven
pairs of runs (``benchmarks/startup.py``).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.machinery import ModuleSpec
from types import ModuleType


class _NoPandas:
    """Reports pandas as not installed."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name == "pandas":
            raise ImportError(name)
        return None


@contextmanager
def without_pandas() -> Iterator[None]:
    """Have pyarrow take arrays, lists and texts without loading pandas, which it imports to see
    whether they are its own; where pandas is loaded already, nothing is different."""
    hidden = _NoPandas()
    if "pandas" not in sys.modules:
        sys.meta_path.insert(0, hidden)
    try:
        yield
    finally:
        if hidden in sys.meta_path:
            sys.meta_path.remove(hidden)
