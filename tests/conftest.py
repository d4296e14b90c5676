"""What every test shares: a cache of compiled models, and one bench per model."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from bench import Bench


def pytest_configure(config: pytest.Config) -> None:
    """Compiled models stay in this checkout, so that the next run starts at once."""
    # the same examples in every run; `--hypothesis-profile=exploring` looks for new ones
    settings.register_profile("same", derandomize=True)
    settings.register_profile("exploring", derandomize=False)
    settings.load_profile(config.getoption("--hypothesis-profile") or "same")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # processes side by side share the cores
    os.environ.setdefault("CLUTCHEST_CACHE", str(config.rootpath / ".pytest_cache" / "clutchest"))
    os.environ["CLUTCHEST_TRUST"] = str(config.rootpath / ".pytest_cache" / "trusted")


@pytest.fixture(scope="session")
def bench() -> Callable[[str], Bench]:
    """``bench(model)``: a vehicle, a drive and the compiled filters of one model, made once."""
    from bench import Bench

    return cache(Bench.of)
