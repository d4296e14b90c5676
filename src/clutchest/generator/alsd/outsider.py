"""Where unmodelled effects act upon the differential; see ``generator.outsider``.

A law is given the true ``time`` s, ``current`` A, ``armature_voltage`` V, ``motor_speed`` rad/s,
``motor_angle``, ``ball_ramp_bristle``, ``wind_up`` rad, ``plate`` and ``free_play`` m,
``pack_force`` N, ``slip_speed`` rad/s, ``clutch_torque`` Nm, ``friction`` (of its nominal
coefficient), ``temp_pack``, ``temp_armature``, ``oil_temp`` °C and ``energy`` J of slip.  It gives
any of ``effects.FOREIGN``.
"""

from __future__ import annotations

from numpy.typing import NDArray

from clutchest.generator.alsd.effects import FOREIGN
from clutchest.generator.outsider import Law, acting
from clutchest.signals import Floats

SLICE = 0.002  # s for which a value of a law holds: the motor starts and stops within 20 ms


def run_under(
    law: Law, profile: NDArray, fast: int, begin: int, y: NDArray, p: NDArray, out: Floats
) -> None:
    """``plant.run`` along ``profile`` (K) from row ``begin`` on in slices, between which ``law``
    may act; see :func:`acting`."""
    from clutchest.generator.alsd import plant

    rows = max(round(SLICE / (fast * plant.STEP)), 1)
    for row in range(begin, len(profile), rows):
        first = max(row - 1, begin)  # a slice begins with the row before it, which is known
        true = {name: float(y[name]) for name in plant.NAMES}
        true |= {name: float(out[first][plant.RECORD.index(name)]) for name in _RECORDED}
        true |= {"time": row * fast * plant.STEP, "oil_temp": float(profile["oil"][row])}
        true |= {"armature_voltage": true["voltage"], "ball_ramp_bristle": true["ramp_bristle"]}
        for name, value in acting(law, true, FOREIGN, "differential").items():
            p[name] = value
        known = out[first].copy()
        plant.run(profile[first : row + rows], fast, y, p, out[first : row + rows])
        if row > begin:
            out[first] = known


_RECORDED = ("friction", "pack_force", "slip_speed", "clutch_torque")
