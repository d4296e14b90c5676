"""python-can without asammdf.

cantools loads python-can, whose own reader of MF4 loads asammdf, and that pandas and more: a DBC
that is read for the first time would take 1.1 s of processor time instead of 0.2.  clutchest reads
MF4 by itself.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

_LOADED_BY, _DEFINES = "can.io.mf4", "MF4Writer"


class _Hidden:
    """Reports asammdf as not installed while python-can's reader is being loaded."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        loading = sys.modules.get(_LOADED_BY) if name == "asammdf" else None
        if loading is not None and not hasattr(loading, _DEFINES):
            raise ImportError(name)
        return None


def hide_asammdf() -> None:
    """From python-can, for the rest of the process: for a program, not for a library."""
    sys.meta_path.insert(0, _Hidden())
