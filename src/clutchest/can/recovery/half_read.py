"""An MDF file that asammdf refuses half way: closed, so that nothing is heard of it later."""

from __future__ import annotations

from traceback import walk_tb
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from asammdf import MDF


def opened(file: Any, **options: Any) -> MDF:
    """The MDF in ``file``, a path or an open one.  Raises whatever asammdf raises."""
    from asammdf import MDF
    from asammdf.blocks.mdf_v4 import MDF4

    try:
        return MDF(file, **options)
    except Exception as error:
        for frame, _ in walk_tb(error.__traceback__):
            half_read = frame.f_locals.get("self")
            if isinstance(half_read, MDF4):
                # Its destructor needs these; without them it prints a traceback of its own.
                for name in ("header", "identification", "_file"):
                    half_read.__dict__.setdefault(name, None)
                half_read.close()
        raise
