from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from clutchest.can.database import Database
from clutchest.can.encode import encode
from clutchest.can.frames import Frames
from clutchest.reading import load_database
from clutchest.shipped import shipped
from clutchest.vehicle import Vehicle, load_vehicle

START = 1_700_000_000_000_000_000  # ns


@pytest.fixture(scope="session")
def real_data() -> Path:
    folder = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the real logs are not on this machine")
    return folder


@pytest.fixture(scope="session")
def truck() -> Vehicle:
    return load_vehicle("truck")


@pytest.fixture(scope="session")
def bus(truck: Vehicle) -> Database:
    return load_database(truck)


@pytest.fixture
def edited(tmp_path: Path) -> Callable[..., Path]:
    """The truck's file with (old, new) texts exchanged; every old one must be there."""

    def write(*changes: tuple[str, str], extra: str = "") -> Path:
        text = shipped("vehicles")["truck"].read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "mine.toml"
        path.write_text(text + extra, encoding="utf-8")
        return path

    return write


@pytest.fixture
def send(bus: Database) -> Callable[..., Frames]:
    """Frames of one message of the truck's DBC, one every ``period`` s from ``start`` s on."""

    def frames(
        message: str, start: float = 0.0, period: float = 0.01, source: int = 0, **values: object
    ) -> Frames:
        n = max(len(np.atleast_1d(np.asarray(v))) for v in values.values())
        t_ns = START + np.round((start + period * np.arange(n)) * 1e9).astype(np.int64)
        columns = {name: np.broadcast_to(np.asarray(v, float), n) for name, v in values.items()}
        return encode(bus.message(message), columns, t_ns, source_address=source)

    return frames
