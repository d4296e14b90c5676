"""Whatever a session stands on may die: then it ends, says so, and what it had is kept."""

from __future__ import annotations

import ctypes
import json
import os
import signal
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import can
import clutchest
from clutchest.can.bus import BusReader, Received, message_of, open_bus
from clutchest.can.files import read_frames
from clutchest.can.frames import Frames
from clutchest.errors import ClutchestError
from clutchest.monitor import listener, live_fault_tests
from clutchest.monitor.faults import FaultWatcher
from clutchest.monitor.listener import Listener, Quiet
from clutchest.monitor.reception import Reception
from clutchest.monitor.worker import Worker
from clutchest.reading import load_database
from clutchest.shipped import locate

LONG = 240.0  # s after which a session that should have ended is ended by the test


@contextmanager
def fed(channel, speed=20.0):
    """A virtual bus with the shipped log on it, ``speed`` times as fast as it was."""
    log = read_frames(locate("demo", "logs")).sorted()
    t = (log.t_ns - log.t_ns[0]) / 1e9 / speed
    done = threading.Event()

    def send():
        begun = time.monotonic()
        with can.Bus(interface="virtual", channel=channel) as bus:
            for row in range(len(log)):
                if done.wait(max(begun + t[row] - time.monotonic(), 0.0)):
                    return
                message = message_of(log, row)
                message.timestamp = log.t_ns[row] / 1e9
                bus.send(message)

    sender = threading.Thread(target=send, name="sender", daemon=True)
    sender.start()
    try:
        yield can.Bus(interface="virtual", channel=channel)
    finally:
        done.set()
        sender.join()


def killed(thread):
    """Let a thread end by an exception of its own, as soon as it runs Python again."""
    raised = ctypes.pythonapi.PyThreadState_SetAsyncExc(
        ctypes.c_ulong(thread.ident), ctypes.py_object(SystemExit)
    )
    assert raised == 1


def assert_kept(out, rows):
    """All that was shown is in the files, which are complete."""
    estimates = pd.read_parquet(out / "estimates.parquet")
    assert len(estimates) >= rows > 0
    truck = clutchest.load_vehicle("truck")
    whole = clutchest.replay(clutchest.read_log(out / "received.log", truck), truck).to_pandas()
    same = whole["temp_disc"].iloc[: len(estimates)]
    assert np.allclose(estimates["temp_disc"], same, rtol=1e-9)
    state = json.loads((out / "state.json").read_text())
    assert state["model"] == "dry_clutch" and not (out / "session.json").exists()
    for line in (out / "events.jsonl").read_text().splitlines():
        json.loads(line)


def session(bus, out, victims):
    """A session with fault tests, of which ``victims()`` die once there are rows; what it says,
    and how many rows it has shown."""
    truck = clutchest.load_vehicle("truck")
    tests = FaultWatcher(truck, load_database(truck), log=out / "received.log")
    monitor = clutchest.Monitor(bus, truck, out=out, watchers=[tests])
    seen = SimpleNamespace(rows=0, dead=False)

    def show(status, piece, events):
        seen.rows = status.rows
        if not seen.dead and status.rows > 50 and (chosen := victims()) is not None:
            chosen()
            seen.dead = True

    with pytest.raises(ClutchestError) as ended:
        monitor.run(LONG, show)
    assert seen.dead and "\n" not in str(ended.value)
    return str(ended.value), seen.rows


THREADS = {
    "listener": "the thread that receives frames has ended (SystemExit",
    "drain recording.rrd": "recording.rrd: cannot be written any more: SystemExit",
}


@pytest.mark.slow
@pytest.mark.parametrize("victim", THREADS)
def test_every_thread_of_a_session_takes_it_with_it(tmp_path, monkeypatch, victim):
    monkeypatch.setattr(live_fault_tests, "FIRST_S", 5.0)  # its process runs, too
    known = set(threading.enumerate())
    names = []

    def victims():
        own = [t for t in threading.enumerate() if t not in known and t.name != "sender"]
        names[:] = [thread.name for thread in own]
        return lambda: killed(next(thread for thread in own if thread.name == victim))

    with fed(f"watchdog-{victim}") as bus:
        words, rows = session(bus, tmp_path / "out", victims)
    assert set(names) == set(THREADS), "another thread needs a test of its own here"
    assert THREADS[victim] in words
    assert_kept(tmp_path / "out", rows)


@pytest.mark.slow
def test_the_process_of_the_fault_tests_takes_it_with_it(tmp_path, monkeypatch):
    monkeypatch.setattr(live_fault_tests, "FIRST_S", 5.0)
    started = []

    class Seen(Worker):
        def __init__(self, what):
            super().__init__(what)
            started.append(self._process)

    monkeypatch.setattr(live_fault_tests, "Worker", Seen)

    def victims():
        return (lambda: os.kill(started[0].pid, signal.SIGKILL)) if started else None

    with fed("watchdog-process") as bus:
        words, rows = session(bus, tmp_path / "out", victims)
    assert "the process of the fault tests of the equations has ended (exit code -9)" in words
    assert_kept(tmp_path / "out", rows)


@pytest.mark.slow
def test_a_recording_whose_writer_died_takes_it_with_it(tmp_path, monkeypatch):
    rerun = pytest.importorskip("rerun")
    flush = rerun.RecordingStream.flush
    dead = []

    def broken(self, **options):
        if dead:
            raise RuntimeError("File-writer thread shut down prematurely")
        flush(self, **options)

    monkeypatch.setattr(rerun.RecordingStream, "flush", broken)
    with fed("watchdog-recording") as bus:
        words, rows = session(bus, tmp_path / "out", lambda: lambda: dead.append(True))
    assert "recording.rrd: cannot be written any more: File-writer thread" in words
    assert_kept(tmp_path / "out", rows)


@pytest.mark.slow
def test_an_output_that_nobody_reads_ends_the_session(tmp_path):
    shown = []

    def show(status, piece, events):
        shown.append(status.rows)
        if status.rows > 50:
            raise BrokenPipeError(32, "Broken pipe")

    with fed("watchdog-pipe") as bus:
        monitor = clutchest.Monitor(bus, "truck", out=tmp_path / "out")
        with pytest.raises(ClutchestError, match=r"written any more: Broken pipe.*are complete"):
            monitor.run(LONG, show)
    assert_kept(tmp_path / "out", shown[-1])


# --- what was lost -------------------------------------------------------------------------------


class Scripted(BusReader):
    """A bus whose readings are said in advance: a number dropped, or an error."""

    def __init__(self, bus, script, dropped=0):
        super().__init__(bus)
        self.dropped, self.script = dropped, script

    def read(self, timeout):
        if not self.script:
            time.sleep(0.01)
            return None
        now = self.script.pop(0)
        if isinstance(now, OSError):
            raise now
        self.dropped = now
        return Received(Frames.empty(), time.monotonic_ns(), now)


@pytest.fixture
def virtual():
    with can.Bus(interface="virtual", channel="lost") as bus:
        yield bus


def lost_after(monkeypatch, bus, *scripts):
    """A reception of buses that are opened anew after each script's error."""
    readers = [Scripted(bus, list(script)) for script in scripts]
    monkeypatch.setattr(listener, "RETRY", 0.01)
    monkeypatch.setattr(listener, "QUIET_NS", 0)
    monkeypatch.setattr(listener, "reader_of", lambda _: readers.pop(0))
    reports = []
    reception = Reception(bus, (), lambda: bus, lambda *what: reports.append(what))
    until = time.monotonic() + 10.0
    while (readers or reception._listener._reader.script) and time.monotonic() < until:
        reception.take(0.05, None)
    reception.take(0.05, None)
    reception.stop()
    dropped = [data["frames_dropped"] for _, _, data in reports if "frames_dropped" in data]
    return reception, dropped


def test_losses_of_every_socket_count(monkeypatch, virtual):
    error = OSError(5, "Input/output error")
    reception, dropped = lost_after(monkeypatch, virtual, [0, 5, error], [0, 3])
    assert reception.lost == sum(dropped) == 8
    assert not reception.losses_known, "nobody knows what was sent while the interface was away"


def test_losses_are_known_where_the_kernel_counts_them(monkeypatch, virtual):
    assert lost_after(monkeypatch, virtual, [0, 0])[0].losses_known
    monkeypatch.undo()
    with can.Bus(interface="virtual", channel="untold") as bus:  # it does not tell
        untold = Reception(bus, (), None, lambda *_: None)
        untold.stop()
    assert not untold.losses_known and untold.lost == 0


@pytest.mark.skipif(not hasattr(os, "posix_fadvise"), reason="Linux counts them")
def test_drops_are_counted_without_another_frame():
    """The kernel says them with the next frame, which may never come."""
    import socket

    from clutchest.can.readers import reader_of

    buses = [open_bus("udp_multicast", "239.74.163.78") for _ in range(2)]
    reader = reader_of(buses[1])
    reader.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8000)
    for _ in range(200):
        buses[0].send(can.Message(arbitration_id=0xCF00400, data=b"12345678"))
    got = 0
    while (received := reader.read(0.2)) is not None:
        got += len(received.frames)
    reader.count()
    for bus in buses:
        bus.shutdown()
    assert 0 < got < 200 and got + reader.dropped == 200


# --- time ----------------------------------------------------------------------------------------


def test_a_process_that_was_stopped_has_heard_nothing_meanwhile(virtual):
    """What came meanwhile is still in the socket: no time may be promised to be over before."""
    heard = Listener(virtual, None)
    reader = Scripted(virtual, [])
    before = time.monotonic_ns()

    def stopped_while_it_waited(timeout):
        heard._done.set()
        time.sleep(0.5)

    reader.read = stopped_while_it_waited
    heard._reader = reader
    heard.run()
    (quiet,) = [heard.received.get_nowait()]
    assert isinstance(quiet, Quiet) and before <= quiet.until_ns < before + 100_000_000
    assert heard.received.empty()
