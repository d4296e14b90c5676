"""A monitor takes its settings as one value or by keyword."""

from dataclasses import FrozenInstanceError

import pytest

import can
import clutchest
from clutchest.errors import ClutchestError
from clutchest.monitor.settings import MonitorSettings


@pytest.fixture
def bus():
    with can.Bus(interface="virtual", channel="settings") as opened:
        yield opened


class Watching:
    """Counts its calls."""

    def __init__(self):
        self.closed = 0

    def watch(self, signals, frames, start_ns, now):
        return []

    def finish(self, now):
        return []

    def close(self):
        self.closed += 1


def test_settings_by_keyword_and_as_a_value(bus, tmp_path):
    first, second = Watching(), Watching()
    monitor = clutchest.Monitor(
        bus, "truck", MonitorSettings(rate=5.0), out=tmp_path / "out", watchers=[first]
    )
    monitor.add_watcher(second)
    assert monitor.settings.rate == 5.0
    status = monitor.run(0.3)
    assert repr(status) == "<SessionStatus: truck, 0.0 s, 0 frames (lost: not known), 0 rows>"
    assert status.frames == 0 and "received.log" in monitor.written
    assert first.closed == second.closed == 1


def test_a_setting_that_there_is_not(bus):
    with pytest.raises(ClutchestError, match="MonitorSettings has no option 'speed'"):
        clutchest.Monitor(bus, "truck", speed=2.0)
    for rate in (0.0, float("nan"), 1000.0):
        with pytest.raises(ClutchestError, match=f"rate {rate:g} Hz: expected 0.1 to 100"):
            clutchest.Monitor(bus, "truck", rate=rate)
    with pytest.raises(FrozenInstanceError):
        MonitorSettings().rate = 1.0
