from __future__ import annotations

from pathlib import Path

import pytest

from clutchest.can.database import Database, load
from clutchest.shipped import locate

_DATA = Path(__file__).parents[2].parent / "shared" / "data"


@pytest.fixture(scope="session")
def real():
    """Gives the path of a recorded log or foreign DBC, or skips where there are none."""

    def path(name: str) -> Path:
        if not (_DATA / name).is_file():
            pytest.skip(f"{name} is not on this machine")
        return _DATA / name

    return path


@pytest.fixture(scope="session")
def truck() -> Database:
    return load([locate("hdt_clutch", "dbc")])
