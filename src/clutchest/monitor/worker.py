"""Long work beside a live session, in a process of its own.

No thread waits for it, and its end is noticed: a session whose tests have died must not go on as
if all was well.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from clutchest.errors import ClutchestError

END_S = 2.0  # for the process to end in


class Worker:
    """A process that does one piece of work at a time; it starts with the first one."""

    def __init__(self, what: str) -> None:
        context = get_context("spawn")
        self._what = what
        self._here, there = context.Pipe()
        self._process = context.Process(target=_work, args=(there,), daemon=True, name=what)
        self._process.start()
        there.close()

    def submit(self, work: Callable[..., Any], *arguments: Any) -> None:
        """Begin ``work(*arguments)``; the one before must have been fetched."""
        try:
            self._here.send((work, arguments))
        except OSError:
            raise self._gone() from None

    @property
    def done(self) -> bool:
        """Whether :meth:`result` has not to wait."""
        return self._here.poll()

    def result(self) -> Any:
        """What the work gave or raised.  Raises ClutchestError where the process has ended."""
        try:
            value = self._here.recv()
        except (EOFError, OSError):
            raise self._gone() from None
        if isinstance(value, BaseException):
            raise value
        return value

    def close(self) -> None:
        """End the process, whatever it does."""
        self._here.close()
        self._process.terminate()
        self._process.join(END_S)

    def _gone(self) -> ClutchestError:
        self._process.join(END_S)
        return ClutchestError(
            f"the process of {self._what} has ended (exit code {self._process.exitcode})"
        )


def _work(there: Connection) -> None:
    """Until the session ends.  An interrupt of the terminal is for the session, not for this."""
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    with suppress(EOFError, OSError):
        while True:
            work, arguments = there.recv()
            try:
                value = work(*arguments)
            except Exception as problem:
                value = problem
            there.send(value)
