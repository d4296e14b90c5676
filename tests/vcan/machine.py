"""A small machine with a CAN bus of its own, on a kernel that has none.

User Mode Linux is a Linux kernel that runs as a plain process.  Debian's package brings one with
the modules for SocketCAN; here it boots on this machine's own files, laid under a layer in memory,
and runs one command with ``vcan0`` up.  It needs no rights and installs nothing.

    python machine.py FOLDER_OF_THE_UNPACKED_PACKAGE COMMAND ARGUMENT…
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

MEMORY = "2G"  # taken as it is used; whatever compiles the filter for the first time needs most
_BOOT = Path(__file__).with_name("machine_boot.py")
_REGISTERS = Path(__file__).with_name("registers.c")
_DIES_WITH_PARENT = 1  # prctl: PR_SET_PDEATHSIG
NEVER_RAN = 125


@dataclass(frozen=True)
class Machine:
    """The unpacked package: its kernel and its modules."""

    kernel: Path
    modules: Path

    @classmethod
    def at(cls, folder: Path) -> Machine | None:
        """What ``folder`` holds, None if it is no such package."""
        kernel = folder / "usr/bin/linux.uml"
        modules = sorted(folder.glob("usr/lib/uml/modules/*/kernel"))
        return cls(kernel, modules[0]) if kernel.exists() and modules else None

    def run(
        self, command: Sequence[str], *, writable: Sequence[Path] = (), seconds: float = 300.0
    ) -> tuple[int, str]:
        """Exit code and everything that ``command`` says.

        It sees all files of this machine; what it writes is lost, but for ``writable`` folders.
        A code of 125 means that the command never ran.
        """
        with tempfile.TemporaryDirectory(prefix="vcan-machine-") as name:
            place = Path(name)
            (place / "order.json").write_text(
                json.dumps(
                    {
                        "command": list(command),
                        "folder": str(Path.cwd()),
                        "environment": dict(os.environ),
                        "modules": str(self.modules),
                        "writable": [str(p.resolve()) for p in (place, *writable)],
                        "answer": str(place / "code"),
                    }
                )
            )
            # the kernel's command line knows no quotes: short names without blanks
            (place / "python").symlink_to(Path(sys.executable).resolve())
            shutil.copy(_BOOT, place / "boot.py")
            said = self._boot(place, seconds)
            try:
                return int((place / "code").read_text()), said
            except (OSError, ValueError):
                return NEVER_RAN, said

    def _boot(self, place: Path, seconds: float) -> str:
        line = [
            str(self.kernel),
            f"mem={MEMORY}",
            "rootfstype=hostfs",
            "rootflags=/",
            "ro",
            "quiet",
            "loglevel=1",
            "panic=-1",
            "con=null",
            "con0=null,fd:1",
            "ssl=null",
            f"uml_dir={place}",
            "umid=machine",
            f"init={place}/python",
            "--",
            "-I",
            f"{place}/boot.py",
            f"{place}/order.json",
        ]

        def alone() -> None:
            ctypes.CDLL(None).prctl(_DIES_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
            # every system call of the guest is a hand-over between two processes of this machine:
            # on one processor that is a switch, on two a wake-up
            os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

        kernel = subprocess.Popen(
            line,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=alone,
            env=os.environ | _all_registers(place),
        )
        try:
            said, _ = kernel.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(kernel.pid, signal.SIGKILL)
            said, _ = kernel.communicate()
            said += f"\nstill running after {seconds:.0f} s\n".encode()
        finally:
            # every process of the guest is one here, and may have been left behind
            with contextlib.suppress(ProcessLookupError):
                os.killpg(kernel.pid, signal.SIGKILL)
        return said.replace(b"\r\n", b"\n").decode("utf-8", "replace")


def _all_registers(place: Path) -> dict[str, str]:
    """What lets the kernel run on a processor with more registers than it knows.

    Nothing where there is no C compiler.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        return {}
    library = place / "registers.so"
    subprocess.run(
        [compiler, "-O2", "-shared", "-fPIC", "-o", library, _REGISTERS, "-ldl"], check=True
    )
    return {"LD_PRELOAD": str(library)}


if __name__ == "__main__":
    machine = Machine.at(Path(sys.argv[1]))
    if machine is None:
        sys.exit(f"{sys.argv[1]}: no unpacked user-mode-linux package")
    code, words = machine.run(sys.argv[2:], writable=[Path.cwd()], seconds=3600.0)
    print(words, end="")
    sys.exit(code)
