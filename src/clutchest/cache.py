"""The cache folder: what takes long to make is kept there from one run to the next."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def cache_folder() -> Path:
    """``CLUTCHEST_CACHE`` if set, else the user's cache folder."""
    from platformdirs import user_cache_path

    chosen = os.environ.get("CLUTCHEST_CACHE")
    return Path(chosen) if chosen else user_cache_path("clutchest", appauthor=False)


def kept(folder: Path, name: str, text: str) -> Path:
    """The file ``name`` in ``folder``, with ``text`` in it unless it is there already."""
    path = folder / name
    if not path.exists():
        with tempfile.NamedTemporaryFile(
            "w", dir=folder, suffix=".tmp", delete=False, encoding="utf-8"
        ) as file:
            file.write(text)
        Path(file.name).replace(path)  # atomic: two processes may do this at once
    return path
