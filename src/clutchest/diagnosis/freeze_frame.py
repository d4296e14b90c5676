"""What held when a fault was detected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchest.diagnosis.isolation import Explanation
from clutchest.estimate.run import Run


def freeze_frame(run: Run, drive: int, time: float, causes: Sequence[Explanation] = ()) -> dict:
    """Mode, states, inputs and ranked causes at ``time`` s of a drive."""
    track, signals = run.tracks[drive], run.signals.drives[drive]
    row = int(np.clip(np.searchsorted(track.time, time, "right") - 1, 0, len(track.time) - 1))
    inputs, torque = {}, track.clutch_torque
    for name, signal in signals.items():
        valid = signal.only_valid()
        at = int(np.searchsorted(valid.time, time, "right")) - 1
        inputs[name] = float(valid.value[at]) if at >= 0 else None
    return {
        "time": float(track.time[row]),
        "mode": track.mode_names[track.mode[row]],
        "states": {
            name: {
                "value": float(e.value[row]),
                "std": float(e.std[row]),
                "valid": bool(e.valid[row]),
            }
            for name, e in track.states.items()
        },
        "clutch_torque": float(torque.value[row]) if torque else None,
        "inputs": inputs,
        "causes": [c.fault for c in causes],
    }
