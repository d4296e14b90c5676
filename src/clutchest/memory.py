"""Memory that is free but that the C library still holds."""

from __future__ import annotations

import ctypes
import sys


def give_back() -> None:
    """Hand it to the system, after a stage of many tables that were needed for a short time: what
    follows may be of other sizes.  Only glibc can; elsewhere nothing is done."""
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "malloc_trim"):
        library.malloc_trim(0)
