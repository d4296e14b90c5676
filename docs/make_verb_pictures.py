"""Draws docs/pictures/inspect.png and docs/pictures/feedforward.png.

    python docs/make_verb_pictures.py

The first is what the terminal shows of the shipped log, drawn with DejaVu Sans Mono; the second
what the differential's motor has to do for steps and a sine of torque.
"""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from make_live_pictures import drawn
from rich.console import Console
from rich.text import Text

import clutchest
from clutchest.can.database import DatabaseFile
from clutchest.reading.inspection import inspect_logs
from clutchest.record.inspection_terminal import print_inspection
from clutchest.shipped import locate

PICTURES = Path(__file__).parent / "pictures"
INCHES = (6.4, 4.6)
ROWS = (
    ("torque (Nm)", {"torque_request": "requested", "friction_potential": "reached"}),
    ("current (A)", {"current_request": "requested", "current": "of the motor"}),
    ("motor angle (rad)", {"motor_angle": ""}),
)


def draw_inspection() -> None:
    """What is on the bus, and which signals may be the estimator's."""
    log = inspect_logs([locate("demo", "logs")], [DatabaseFile(locate("hdt_clutch", "dbc"))])
    console = Console(width=80, file=io.StringIO(), force_terminal=True)
    print_inspection(log, console)
    picture = drawn(Text.from_ansi(console.file.getvalue()))
    picture.quantize(64).save(PICTURES / "inspect.png", optimize=True)


def draw_feedforward() -> None:
    """Torque, current and angle for a request that steps, then swings once per second."""
    time = np.arange(0.0, 9.0, 0.005)
    steps = np.select([time < 1.0, time < 3.0, time < 5.0], [0.0, 300.0, 700.0], 400.0)
    torque = np.where(time < 6.0, steps, 400.0 + 200.0 * np.sin(2.0 * np.pi * time))
    plan = clutchest.feedforward("alsd_rig", (time, torque))
    figure, axes = plt.subplots(len(ROWS), 1, sharex=True, figsize=INCHES, layout="constrained")
    for axis, (title, lines) in zip(axes, ROWS, strict=True):
        for column, label in lines.items():
            axis.plot(plan.columns["time"], plan.columns[column], label=label, linewidth=1.2)
        axis.set_ylabel(title)
        axis.grid(alpha=0.3)
        if any(lines.values()):
            axis.legend(loc="upper right", fontsize="small")
    axes[-1].set_xlabel("time (s)")
    figure.savefig(PICTURES / "feedforward.png", dpi=130)


if __name__ == "__main__":
    draw_inspection()
    draw_feedforward()
