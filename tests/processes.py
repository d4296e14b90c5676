"""Programs of their own on a bus that needs no hardware."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

GROUP = "239.74.163.2"


class Bus:
    """A bus of its own: on one machine all groups of a port are received together.

    What a program says goes to files in ``folder``, so that it never waits for a reader.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("", 0))
            config = json.dumps({"port": probe.getsockname()[1]})
        self.started: list[subprocess.Popen] = []
        self.environment = {**os.environ, "CAN_CONFIG": config}

    def start(self, name: str, *arguments: Any, **more: Any) -> subprocess.Popen:
        """A clutchest on this bus, whose words go under ``name``."""
        command = [sys.executable, "-m", "clutchest", *map(str, arguments)]
        command += ["--interface", "udp_multicast", "--channel", GROUP]
        out, err = (self.folder / f"{name}.{end}" for end in ("out", "err"))
        with out.open("w") as words, err.open("w") as errors:
            process = subprocess.Popen(
                command, stdout=words, stderr=errors, env=self.environment, **more
            )
        self.started.append(process)
        return process

    def close(self) -> None:
        """End what still runs."""
        for process in self.started:
            process.kill()
            process.wait()

    def said(self, name: str, what: str = "out") -> str:
        """What a program has said so far on stdout, or on ``err``."""
        return (self.folder / f"{name}.{what}").read_text()


def written_by(out: Path) -> int:
    """Bytes of estimates that a session has put on disk so far."""
    growing = out / "estimates.growing"
    return growing.stat().st_size if growing.exists() else 0


def wait_for(what: Callable[[], Any], seconds: float = 240.0) -> None:
    """Until ``what()`` is true."""
    until = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < until, "timed out"
        time.sleep(0.05)
