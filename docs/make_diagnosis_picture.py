"""Draws docs/diagnosis.png: what the viewer shows when the recording of a diagnosis is opened.

    python docs/make_diagnosis_picture.py

A truck whose engine reports 60 Nm too much, and whose slave sensor is stuck later on.  Needs what
make_picture.py needs.
"""

from __future__ import annotations

import io
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from make_picture import MENU, photograph
from PIL import Image

import clutchest
from clutchest.record.diagnosis import write_diagnosis

PICTURE = Path(__file__).with_name("diagnosis.png")
STUCK = 430.0  # s


def main() -> None:
    """Diagnose such a drive, open its recording without a window and save what is seen."""
    truck = clutchest.load_vehicle("truck")
    signals = clutchest.simulate(truck, "city", 51, {"torque_bias": {"bias": 60.0}}, duration=600.0)
    slave = signals["slave_position"]
    after = slave.time > STUCK
    held = replace(slave, value=np.where(after, slave.value[~after][-1], slave.value))
    signals = replace(signals, signals={**signals.signals, "slave_position": held})
    found = clutchest.diagnose(clutchest.replay(signals, truck))
    with tempfile.TemporaryDirectory() as folder:
        write_diagnosis(found, Path(folder))
        shot = photograph(Path(folder) / "recording.rrd")
    picture = Image.open(io.BytesIO(shot)).convert("RGB")
    picture = picture.crop((0, MENU, picture.width, picture.height))
    picture.quantize(128).save(PICTURE, optimize=True)
    print(f"Written: {PICTURE}, {PICTURE.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
