from __future__ import annotations

import pytest


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test that asks for ``model`` alone runs for every model."""
    names = [m.args[0] for m in metafunc.definition.iter_markers("parametrize")]
    if "model" in metafunc.fixturenames and not any("model" in n for n in names):
        from bench import BENCHES

        metafunc.parametrize("model", list(BENCHES))
