"""Draws docs/replay.png: what the viewer shows when the recording of a replay is opened.

    python docs/make_picture.py [LOG [VEHICLE]]

Needs a Vulkan driver; without a graphics card Mesa's software one does
(``apt-get install mesa-vulkan-drivers libvulkan1``).
"""

from __future__ import annotations

import io
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

import clutchest

PICTURE = Path(__file__).with_name("replay.png")
MENU = 38  # pixels at the top: the viewer's own menu, with remarks on the driver
SETTLES_WITHIN = 60.0  # s


def main(log: str = "demo", vehicle: str = "truck") -> None:
    """Replay ``log``, open the recording without a window and save what is seen."""
    car = clutchest.load_vehicle(vehicle)
    run = clutchest.replay(clutchest.read_log(log, car), car)
    with tempfile.TemporaryDirectory() as folder:
        clutchest.write_run(run, Path(folder))
        shot = photograph(Path(folder) / "recording.rrd")
    picture = Image.open(io.BytesIO(shot)).convert("RGB")
    picture = picture.crop((0, MENU, picture.width, picture.height))
    picture.quantize(128).save(PICTURE, optimize=True)
    print(f"Written: {PICTURE}, {PICTURE.stat().st_size // 1024} KiB")


@contextmanager
def viewer() -> Iterator[ViewerClient]:
    """A viewer without a window."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = Path(sys.executable).with_name("rerun")
    client = ViewerClient.spawn(
        headless=True, port=port, hide_welcome_screen=True, executable_path=str(command)
    )
    try:
        yield client
    finally:
        client.quit()


def photograph(recording: Path) -> bytes:
    """The viewer's whole window as PNG, once nothing in it moves any more."""
    with viewer() as client:
        client.open(str(recording))
        time.sleep(12.0)  # messages of the start have faded by then
        last, until = client.take_screenshot(), time.monotonic() + SETTLES_WITHIN
        while time.monotonic() < until:
            time.sleep(1.0)
            shot = client.take_screenshot()
            if shot == last:
                return shot
            last = shot
    sys.exit(f"the viewer still moves after {SETTLES_WITHIN:.0f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
