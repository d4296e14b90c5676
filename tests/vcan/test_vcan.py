"""The tests on a real SocketCAN bus, on whatever machine there is.

They run right here where ``vcan0`` is or can be made, else in a small machine of their own
(``machine.py``), for which ``CLUTCHEST_UML`` names the unpacked user-mode-linux package, else not
at all.  With ``CLUTCHEST_VCAN=required`` that is a failure.
"""

import os
import socket
import sys
from pathlib import Path

import pytest

import clutchest
from vcan import machine_boot
from vcan.machine import Machine

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent


def natively() -> str:
    """Why there is no vcan0 on this machine; empty if there is."""
    if sys.platform != "linux":
        return f"{sys.platform} has no SocketCAN"
    if "vcan0" in (name for _, name in socket.if_nameindex()):
        return ""
    try:
        machine_boot.bus("vcan0")
    except OSError as problem:
        return f"vcan0 cannot be made here: {problem.strerror}"
    return ""


def test_on_a_real_bus(tmp_path, pytestconfig):
    why = natively()
    report = tmp_path / "report.xml"
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "--durations=0",
        "-m",
        "vcan",
        "-p",
        "no:cacheprovider",
        "-o",
        "addopts=--strict-markers --import-mode=importlib",
        f"--junitxml={report}",
        f"--basetemp={tmp_path / 'inside'}",
        str(HERE / "on_vcan.py"),
    ]
    if not why:
        import subprocess

        done = subprocess.run(command, capture_output=True, text=True, check=False)
        code, said = done.returncode, done.stdout + done.stderr
    else:
        folder = os.environ.get("CLUTCHEST_UML")
        machine = Machine.at(Path(folder)) if folder else None
        if machine is None:
            why += (
                "; CLUTCHEST_UML names no unpacked user-mode-linux package (apt-get download "
                "user-mode-linux; dpkg -x user-mode-linux_*.deb FOLDER)"
            )
            if os.environ.get("CLUTCHEST_VCAN") == "required":
                pytest.fail(why)
            pytest.skip(why)
        # compiled here, where it is quick, and kept: the machine's own files are gone with it
        truck = clutchest.load_vehicle("truck")
        clutchest.replay(clutchest.read_log("demo", truck), truck)
        code, said = machine.run(command, writable=[tmp_path], seconds=400.0)
    print(said)
    assert code == 0, said
    text = report.read_text()
    assert 'skipped="0"' in text and 'tests="0"' not in text, said
