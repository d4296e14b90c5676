"""What Windows and macOS lack or refuse, taken away here: the source must not need it."""

from __future__ import annotations

import ast
import os
import socket
import sys
from pathlib import Path

import pytest

import clutchest
from clutchest.can import multicast
from clutchest.can.readers import reader_of
from clutchest.monitor.store import Session

SOURCE = Path(clutchest.__file__).parent


def _open_here(path: Path) -> bool:
    """Whether this process holds the file open."""
    held = (os.path.realpath(each) for each in Path("/proc/self/fd").iterdir())
    return str(path.resolve()) in set(held)


@pytest.fixture
def as_on_windows(monkeypatch):
    """No locks; a file that is open is neither removed nor renamed."""
    if not Path("/proc/self/fd").exists():
        pytest.skip("open files are told by /proc")
    monkeypatch.setitem(sys.modules, "fcntl", None)
    for name in ("unlink", "rename", "replace"):
        done = getattr(Path, name)

        def refused(self, *given, done=done, **named):
            if _open_here(self):
                raise PermissionError(13, "in use by another process", str(self))
            return done(self, *given, **named)

        monkeypatch.setattr(Path, name, refused)


def test_a_session_ends_where_open_files_cannot_be_removed(as_on_windows, tmp_path):
    session = Session(tmp_path, {})
    assert (tmp_path / "session.json").exists()
    assert session.close({"states": []}) == ["received.log", "events.jsonl", "state.json"]
    assert not (tmp_path / "session.json").exists()
    again = Session(tmp_path, {})
    assert len(again.notes) == 1 and "are now in" in again.notes[0]
    again.close()


def test_results_are_written_where_open_files_cannot_be_moved(as_on_windows, tmp_path):
    truck = clutchest.load_vehicle("truck")
    run = clutchest.replay(clutchest.read_log("demo", truck, (0, 20)), truck)
    for _ in range(2):  # the second time over the files of the first
        written = {path.name for path in run.save(tmp_path, report=True, innovations=True)}
        assert {"estimates.parquet", "summary.json", "report.html"} <= written
    assert {path.name for path in tmp_path.iterdir()} == written


@pytest.mark.parametrize("loopback", ["lo", "lo0"])
def test_the_loopback_is_joined_as_the_system_calls_it(loopback, monkeypatch):
    def index_of(name):
        if name != loopback:
            raise OSError(6, "no such interface")
        return 7

    class Recording:
        family, joined = socket.AF_INET, []

        def setsockopt(self, level, option, value):
            if option == socket.IP_ADD_MEMBERSHIP:
                self.joined.append(value)

    monkeypatch.setattr(socket, "if_nametoindex", index_of)
    sock = Recording()
    sock.joined = []
    multicast.listen_on([sock], "239.74.163.77", "")  # type: ignore[list-item]
    assert [value[-4:] for value in sock.joined] == [(7).to_bytes(4, sys.byteorder)]


def test_a_bus_is_read_by_its_own_means_where_sockets_know_less(monkeypatch):
    """Windows' sockets have no ``recvmsg``."""

    class UdpMulticastBus:
        socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    monkeypatch.setattr("clutchest.can.readers.os.name", "nt")
    assert type(reader_of(UdpMulticastBus())).__name__ == "BusReader"  # type: ignore[arg-type]
    UdpMulticastBus.socket.close()


def _without_encoding(path: Path) -> list[str]:
    """Calls in a source file that take the system's encoding, which is not UTF-8 everywhere."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name not in ("read_text", "write_text", "open") or any(
            each.arg == "encoding" for each in node.keywords
        ):
            continue
        first = (
            0 if isinstance(node.func, ast.Attribute) else 1
        )  # open(path, mode), path.open(mode)
        modes = [each.value for each in node.keywords if each.arg == "mode"] + node.args[first:]
        mode = getattr(modes[0], "value", "b") if modes else "r"
        if name != "open" or (isinstance(mode, str) and "b" not in mode):
            found.append(f"{path.name}:{node.lineno}")
    return found


def test_no_text_is_read_or_written_in_the_systems_encoding(tmp_path):
    careless = tmp_path / "careless.py"
    careless.write_text("path.read_text()\nopen(path)\npath.open('w')\nopen(path, 'rb')\n")
    assert len(_without_encoding(careless)) == 3
    opened = [each for path in SOURCE.rglob("*.py") for each in _without_encoding(path)]
    assert not opened
