"""Makes the seeds anew: a few frames of every kind in every format that is written.

PYTHONPATH=tests python -m fuzz.make_seeds; the other seeds were written by hand.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from clutchest.can.files import write_frames
from clutchest.can.formats import log_formats
from clutchest.can.frames import Flag
from logger_mf4 import logged
from samples import random_frames

SEEDS = Path(__file__).parent / "seeds"


def main() -> None:
    for suffix in (entry.suffix for entry in log_formats() if entry.writable):
        frames = random_frames(12, seed=1, fd=True)
        classic = np.flatnonzero((frames.flags & Flag.FD) == 0)
        frames.flags[classic[0]] |= np.uint8(Flag.REMOTE)
        frames.data[classic[0]] = 0
        frames.flags[classic[1]], frames.length[classic[1]] = Flag.ERROR, 0
        frames.data[classic[1]] = 0
        write_frames(frames, SEEDS / f"written{suffix}")
    path = SEEDS / "logger.mf4"
    path.write_bytes(logged(random_frames(12, seed=1), path, "deflated")[0])
    path.with_name("plain.mf4").unlink()
    # The objects themselves, so that damage reaches them.
    import zlib

    content = (SEEDS / "written.blf").read_bytes()
    size = int.from_bytes(content[144 + 8 : 144 + 12], "little")
    (SEEDS / "loose.blf").write_bytes(
        content[:144] + zlib.decompress(content[144 + 32 : 144 + size])
    )


if __name__ == "__main__":
    main()
