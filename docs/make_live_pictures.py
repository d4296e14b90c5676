"""Draws docs/panel.png and docs/viewer.png: a live session in the terminal and in the viewer.

    python docs/make_live_pictures.py

Plays the shipped log over udp_multicast to a monitor that serves a viewer.  The viewer needs a
Vulkan driver, see make_picture.py; the terminal is drawn with DejaVu Sans Mono.
"""

from __future__ import annotations

import io
import multiprocessing
import tempfile
import time
from pathlib import Path

from make_picture import MENU, viewer
from PIL import Image, ImageDraw, ImageFont
from rich.console import Console, RenderableType
from rich.terminal_theme import MONOKAI

import clutchest
from clutchest.can.bus import open_bus
from clutchest.can.player import play
from clutchest.monitor.panel import panel
from clutchest.shipped import locate

HERE = Path(__file__).parent
SIZE, WIDTH = 15, 104  # pixels of a letter, letters in a line
FONT = "/usr/share/fonts/truetype/dejavu/DejaVuSansMono{}.ttf"
LOOK_AT = 90.0  # s of the log: behind the second slip event


def send() -> None:
    """The shipped log, onto the bus."""
    bus = open_bus("udp_multicast", None)
    play(locate("demo", "logs"), bus)


def drawn(renderable: RenderableType) -> Image.Image:
    """What a terminal shows, letter by letter."""
    console = Console(
        width=WIDTH, force_terminal=True, color_system="truecolor", file=io.StringIO()
    )
    lines = console.render_lines(renderable, pad=True)
    plain, bold = (ImageFont.truetype(FONT.format(kind), SIZE) for kind in ("", "-Bold"))
    wide, high = plain.getlength("M"), round(1.3 * SIZE)
    ground = MONOKAI.background_color
    picture = Image.new("RGB", (round(wide * WIDTH), high * (len(lines) + 1)), tuple(ground))
    pen = ImageDraw.Draw(picture)
    for row, line in enumerate(lines):
        column = 0
        for segment in line:
            style = segment.style or console.get_style("none")
            ink = style.color.get_truecolor(MONOKAI) if style.color else MONOKAI.foreground_color
            paper = style.bgcolor.get_truecolor(MONOKAI) if style.bgcolor else ground
            if style.reverse:
                ink, paper = paper, ink
            if style.dim:
                ink = [(a + b) // 2 for a, b in zip(ink, ground, strict=True)]
            for letter in segment.text:
                x, y = column * wide, high * row + high // 2
                if style.reverse:
                    pen.rectangle((x, y, x + wide, y + high), fill=tuple(paper))
                pen.text((x, y), letter, fill=tuple(ink), font=bold if style.bold else plain)
                column += 1
    return picture


def main() -> None:
    """One session, two pictures."""
    with tempfile.TemporaryDirectory() as folder:
        monitor = clutchest.Monitor(
            open_bus("udp_multicast", None), "truck", out=Path(folder), serve=(9976, 9977)
        )
        player = multiprocessing.get_context("fork").Process(target=send, daemon=True)
        player.start()
        with viewer() as client:
            time.sleep(5.0)
            client.open("rerun+http://127.0.0.1:9976/proxy")
            shots: dict[str, Image.Image] = {}

            def show(status, piece, events):
                if status.now > LOOK_AT and piece is not None and not shots:
                    shots["panel"] = drawn(panel(status, monitor.vehicle.machine))
                    shot = Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")
                    shots["viewer"] = shot.crop((0, MENU, shot.width, shot.height))
                    monitor.stop()

            monitor.run(LOOK_AT + 60.0, show)
        player.kill()
    for name, picture in shots.items():
        path = HERE / f"{name}.png"
        picture.quantize(128).save(path, optimize=True)
        print(f"Written: {path}, {path.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
