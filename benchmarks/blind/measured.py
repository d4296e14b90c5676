"""Run a command and write what it took to a file: ``measured.py FILE COMMAND…``.

A small process of its own: what the kernel counts as a child's memory begins with its parent's.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path

if __name__ == "__main__":
    status = subprocess.run(sys.argv[2:]).returncode
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = {"seconds": used.ru_utime + used.ru_stime, "MiB": used.ru_maxrss / 1024}
    Path(sys.argv[1]).write_text(json.dumps({**took, "exit": status}), encoding="ascii")
