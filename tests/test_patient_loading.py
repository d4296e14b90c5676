"""Libraries are loaded while nobody is at work in Python, or once somebody may wait for them."""

from __future__ import annotations

import sys
from importlib import import_module
from threading import Thread

import pytest

from clutchest import patient_loading
from clutchest.patient_loading import at_work, in_compiled_code, load_patiently

LIBRARY, OTHER = "made_for_patience", "made_for_haste"


@pytest.fixture(autouse=True)
def libraries(tmp_path, monkeypatch):
    """Two modules that are not loaded yet."""
    for name in (LIBRARY, OTHER):
        (tmp_path / f"{name}.py").write_text("answer = 42\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    for name in (LIBRARY, OTHER):
        sys.modules.pop(name, None)


def loading(name):
    thread = Thread(target=load_patiently, args=([name],))
    thread.start()
    return thread


def test_loading_waits_for_who_is_at_work(monkeypatch):
    monkeypatch.setattr(patient_loading, "PATIENCE_S", 60.0)
    with at_work():
        thread = loading(LIBRARY)
        thread.join(0.2)
        assert LIBRARY not in sys.modules
        with in_compiled_code():
            thread.join(30.0)
            assert sys.modules[LIBRARY].answer == 42


def test_who_is_at_work_does_not_wait_for_ever_for_what_is_being_loaded():
    with at_work():
        thread = loading(LIBRARY)
        import_module(OTHER)
        import_module(LIBRARY)
    thread.join(30.0)


def test_nothing_stays_behind_in_the_search_for_modules():
    before = list(sys.meta_path)
    load_patiently([LIBRARY])
    with pytest.raises(ModuleNotFoundError):
        load_patiently(["no_module_of_this_name"])
    assert sys.meta_path == before
