"""Times of a table's rows: dates, times of day, stamps since 1970, days since 1900."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from table_rows import SPEED, TIME, N, written


def test_iso_times_are_absolute(truck, tmp_path):
    times = pd.Timestamp("2024-01-18T10:30:00+01:00") + pd.to_timedelta(TIME, "s")
    rows = [f"{t.isoformat()},{v!r}" for t, v in zip(times, SPEED.tolist(), strict=True)]
    signals = read_log(written(tmp_path, "\n".join(["Timestamp,engine_speed", *rows])), truck)
    assert signals.start_ns == pd.Timestamp("2024-01-18T09:30:00Z").value
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-6)


@pytest.mark.parametrize("factor", [1.0, 1e3, 1e6, 1e9])
def test_stamps_since_1970_in_any_unit(factor, truck, tmp_path):
    start = 1.7e9
    rows = [
        f"{(start + t) * factor:.0f},{v!r}" if factor > 1 else f"{start + t!r},{v!r}"
        for t, v in zip(TIME.tolist(), SPEED.tolist(), strict=True)
    ]
    signals = read_log(written(tmp_path, "\n".join(["timestamp,engine_speed", *rows])), truck)
    assert signals.start_ns == pytest.approx(1_700_000_000_000_000_000, abs=1e3)
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-6)


CLOCKS = {
    "%d.%m.%Y %H:%M:%S.%f": True,
    "%d.%m.%Y %H:%M:%S,%f": True,
    "%H:%M:%S.%f": False,
    "%Y-%m-%d %H:%M:%S.%f": True,
    "%m/%d/%Y %H:%M:%S.%f": True,
    "%d/%m/%Y %H:%M:%S.%f": True,
    "%m/%d/%Y %I:%M:%S.%f %p": True,
}


@pytest.mark.parametrize("style", CLOCKS)
def test_dates_and_times_of_day_go_on_behind_midnight(truck, tmp_path, style):
    stamps = pd.Timestamp("2024-02-29 23:59:59.500") + pd.to_timedelta(TIME, unit="s")
    frame = pd.DataFrame({"time": stamps.strftime(style), "engine_speed": SPEED})
    frame.to_csv(tmp_path / "a.csv", index=False, sep=";")
    log = read_log(tmp_path / "a.csv", truck)
    np.testing.assert_allclose(log["engine_speed"].time, TIME, atol=2e-6)
    said = any("a.csv: time begins at 86399.5 s; counted from there" in w for w in log.warnings)
    assert said == (not CLOCKS[style])  # the day is not stated
    assert log.start_ns == (stamps[0].value if CLOCKS[style] else None)


def test_dates_of_which_the_day_may_be_the_month_are_refused(truck, tmp_path):
    stamps = pd.Timestamp("2024-02-03 23:00") + pd.to_timedelta(TIME, unit="s")
    frame = pd.DataFrame({"time": stamps.strftime("%d/%m/%Y %H:%M:%S.%f"), "engine_speed": SPEED})
    frame.to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(ClutchestError, match=r"a\.csv: the time '03/02/2024 .* day or month"):
        read_log(tmp_path / "a.csv", truck)


def test_minutes_and_seconds_go_on_behind_the_hour(truck, tmp_path):
    """As Excel shows times, and saves them in a csv."""
    seconds = 3599.0 + TIME
    stamps = [f"{s % 3600 // 60:02.0f}:{s % 60:06.3f}" for s in np.round(seconds, 3)]
    frame = pd.DataFrame({"time": stamps, "engine_speed": SPEED})
    frame.to_csv(tmp_path / "a.csv", index=False)
    log = read_log(tmp_path / "a.csv", truck)
    np.testing.assert_allclose(log["engine_speed"].time, TIME, atol=1e-9)


NOON = pd.Timestamp("2026-02-28 12:00")
DAYS = {  # numbers of noon on that day, and what is said of them
    "Excel": (46_081.5, NOON),
    "MATLAB": (740_041.5, NOON),
    "parts of a day": (0.5, None),
}


@pytest.mark.parametrize("who", DAYS)
@pytest.mark.parametrize("header", ["time", "time [d]"])
def test_days_as_numbers(truck, tmp_path, who, header):
    first, noon = DAYS[who]
    rows = [f"{first + t / 86_400:.12f},{v}" for t, v in zip(TIME, SPEED, strict=True)]
    log = read_log(written(tmp_path, "\n".join([f"{header},engine_speed", *rows])), truck)
    np.testing.assert_allclose(log["engine_speed"].time, TIME, atol=2e-5)
    assert (log.start_ns is None) == (noon is None)
    if noon is not None:
        assert log.start_ns == pytest.approx(noon.value, abs=2e4)
    said = any(f"days, {who}" in w or f"as {who}" in w for w in log.warnings)
    assert said == (header == "time")


@pytest.mark.parametrize("first", [0.0, 0.5, 46_081.5, 740_041.5])
def test_seconds_that_look_like_days_stay_seconds(truck, tmp_path, first):
    times = first + 1e-4 * np.arange(N)  # the fastest that a logger of such signals samples
    rows = [f"{t:.6f},{v}" for t, v in zip(times, SPEED, strict=True)]
    log = read_log(written(tmp_path, "\n".join(["time,engine_speed", *rows])), truck)
    np.testing.assert_allclose(log["engine_speed"].time, times - first, atol=1e-6)


@pytest.mark.parametrize("first", [-3.0, 3.0, 1000.0])
def test_a_piece_of_a_longer_record_is_counted_from_its_first_row(truck, tmp_path, first):
    """Estimates, windows and what is judged over stretches count from a drive's start."""
    rows = [f"{first + t:.6f},{v}" for t, v in zip(TIME, SPEED, strict=True)]
    log = read_log(written(tmp_path, "\n".join(["time,engine_speed", *rows])), truck)
    np.testing.assert_allclose(log["engine_speed"].time, TIME, atol=1e-6)
    assert log.end == pytest.approx(TIME[-1], abs=1e-6)
    assert f"time begins at {first:g} s; counted from there" in " ".join(log.warnings)


def test_signals_that_begin_one_after_another_keep_their_times(truck, tmp_path):
    """The first within the longest step of any of them, as of messages of several periods."""
    rows = [
        f"{0.003 + t:.6f},{v},{80.0 if k % 10 == 5 else ''}"
        for k, (t, v) in enumerate(zip(TIME, SPEED, strict=True))
    ]
    log = read_log(written(tmp_path, "\n".join(["time,engine_speed,coolant_temp", *rows])), truck)
    np.testing.assert_allclose(log["engine_speed"].time, 0.003 + TIME, atol=1e-6)


@pytest.mark.parametrize("clock", ["00:00:{:06.3f}", "00:{:04.1f}"], ids=["day", "hour"])
def test_a_row_without_a_time_of_day_is_rejected(clock, truck, tmp_path):
    rows = [f"{clock.format(0.1 * k)},{SPEED[k]!r}" for k in range(100)]
    rows[50] = f",{SPEED[50]!r}"
    signals = read_log(written(tmp_path, "\n".join(["time,engine_speed", *rows])), truck)
    assert len(signals["engine_speed"]) == 99
