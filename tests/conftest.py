"""What every test shares: a cache of compiled models, and one bench per model."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from bench import Bench


def pytest_configure(config: pytest.Config) -> None:
    """Compiled models stay in this checkout, so that the next run starts at once."""
    os.environ.setdefault("CLUTCHEST_CACHE", str(config.rootpath / ".pytest_cache" / "clutchest"))


@pytest.fixture(scope="session")
def bench() -> Callable[[str], Bench]:
    """``bench(model)``: a vehicle, a drive and the compiled filters of one model, made once."""
    from bench import Bench

    return cache(Bench.of)
