"""A viewer for the browser beside a live session, which ends with it, however it ends."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress

from clutchest.errors import ClutchestError

HERE = "127.0.0.1"
END_S = 5.0  # for the viewer to end in

# Rerun's command is a program of its own behind a Python; both end with this one, which ends when
# the session closes its input or is gone, or when the viewer has ended by itself.
_KEEPER = """
import os, signal, subprocess, sys, threading
viewer = subprocess.Popen([sys.executable, "-m", "rerun_cli", *sys.argv[1:]],
                          stdin=subprocess.DEVNULL)
def end():
    if hasattr(os, "killpg"):
        os.killpg(os.getpgrp(), signal.SIGKILL)
    subprocess.run(["taskkill", "/F", "/T", "/PID", str(os.getpid())])
def until_it_ends():
    viewer.wait()
    end()
threading.Thread(target=until_it_ends, daemon=True).start()
sys.stdin.buffer.read()
end()
"""


def refuse_taken(ports: Sequence[int]) -> None:
    """Raises ClutchestError for a port that another program listens on."""
    for port in ports:
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            if sys.platform != "win32":  # what an earlier session has just left is free
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((HERE, port))
            except OSError as problem:
                raise ClutchestError(
                    f"--serve: port {port} of {HERE}: {problem.strerror}; --port N takes the ports "
                    "N and N - 1"
                ) from None


class Viewer:
    """A viewer at ``address`` that shows what a server at ``uri`` has."""

    def __init__(self, uri: str, port: int) -> None:
        options = ["--serve-web", "--bind", HERE, "--web-viewer-port", str(port), uri]
        self._keeper = subprocess.Popen(
            [sys.executable, "-c", _KEEPER, *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        shown = uri.replace("+", "%2B").replace(":", "%3A").replace("/", "%2F")
        self.address = f"http://{HERE}:{port}?url={shown}"

    def close(self) -> None:
        """End the viewer."""
        assert self._keeper.stdin is not None
        self._keeper.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self._keeper.wait(END_S)
