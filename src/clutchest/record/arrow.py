"""pyarrow without pandas, which takes longer to load than a short drive takes to filter."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

import numpy as np


class _NoPandas:
    """Says of pandas that it is not there."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name == "pandas":
            raise ImportError(name)
        return None


def spare_pandas() -> None:
    """Have pyarrow take arrays without loading pandas.

    It looks for pandas once, when it is given its first array.  Told that there is none, it looks
    again only where somebody asks it for a DataFrame.
    """
    import pyarrow as pa

    if "pandas" in sys.modules:
        return
    hidden = _NoPandas()
    sys.meta_path.insert(0, hidden)
    try:
        pa.array(np.zeros(1))
    finally:
        sys.meta_path.remove(hidden)
