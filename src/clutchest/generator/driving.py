"""The truck driven: actuator, control unit and equations, one STEP after the other.

Its text joins that of the truck's other files in one generated module: see ``generator.plant``.
"""

from __future__ import annotations

import numpy as np

from clutchest.generator.control_unit import (
    control,
)
from clutchest.generator.physics import (
    advance,
    capacity,
    expansion,
    transmitted,
    zero_reference,
)
from clutchest.generator.situation import (
    BODY,
    DISC,
    ENERGY,
    ENGINE,
    FAST,
    HOUSING,
    PORT,
    RETRACT,
    SERVO_LAG,
    SERVO_RATE,
    SHAFT,
    SPEED,
    STEP,
    TORQUE,
    Record,
    TruckDrive,
    TruckRecord,
)
from clutchest.generator.surroundings import (
    GRID,
)
from clutchest.native import compiled
from clutchest.signals import Floats

# --- the generated module goes on from here ---


@compiled
def actuate(y: Floats, s: Record, p: Record) -> None:
    """Motor, slave piston and plate one STEP on, towards the command.

    Fully retracted, the hydraulic port opens and the piston rests on the clutch, wherever heat and
    wear have put it; from there the trapped fluid carries it.  Commands count from that position,
    so the truck follows the wear of its clutch, as any such truck does.
    """
    goal = -1.0 if s.command == RETRACT else s.command
    rate = min(max((goal - s.motor) / SERVO_LAG, -SERVO_RATE), SERVO_RATE)
    s.motor = max(s.motor + rate * STEP, 0.0)
    contact = zero_reference(y[ENERGY], s, p) + expansion(y[BODY], y[DISC], p) - p.position_origin
    if s.motor == 0.0:
        s.port = contact
    trapped = contact + (s.port - contact) * min(s.motor / PORT, 1.0) + s.motor
    s.slave = max(contact, trapped)
    s.plate_before = s.plate
    s.plate = min(max(s.plate, s.slave - p.play), s.slave + p.play)


@compiled
def note(k: int, drive: TruckDrive, record: TruckRecord) -> None:
    """Write what is at STEP k into the record."""
    s, p, y = drive.situation[0], drive.numbers[0], drive.state
    if k % FAST == 0:
        out = record.fast[k // FAST]
        out[0], out[1], out[2] = y[ENGINE], y[SHAFT], s.slave
        out[3], out[4], out[5] = s.motor, y[TORQUE], y[SPEED]
    if k % record.truth_every == 0:
        row_out = record.truth[k // record.truth_every]
        row_out[0], row_out[1], row_out[2] = y[BODY], y[HOUSING], y[DISC]
        row_out[3] = zero_reference(y[ENERGY], s, p)
        row_out[4], row_out[5], row_out[6] = s.friction, s.carried, y[ENERGY]
        if s.locked:
            row_out[7] = 3.0 if s.motor == 0.0 else 2.0
        else:
            row_out[7] = 1.0 if capacity(y, s.plate, s, p) > 0.0 else 0.0


@compiled
def run(begin: int, end: int, substeps: int, drive: TruckDrive, record: TruckRecord) -> None:
    """The STEPs ``begin`` … ``end`` − 1 of a drive; in pieces it is the same drive."""
    legs, slow, y = drive.legs, drive.slow, drive.state
    s, p = drive.situation[0], drive.numbers[0]
    work = np.empty((5, len(y)))
    for k in range(begin, end):
        time = k * STEP
        place = time / GRID
        row = int(place)
        share = place - row
        s.friction = slow[row, 0] + share * (slow[row + 1, 0] - slow[row, 0])
        s.coolant = slow[row, 1] + share * (slow[row + 1, 1] - slow[row, 1])
        s.ambient = slow[row, 2] + share * (slow[row + 1, 2] - slow[row, 2])
        s.carried = transmitted(y, s.plate, s, p)
        note(k, drive, record)
        control(time, legs, y, s, p)
        actuate(y, s, p)
        advance(y, substeps, s, p, work)
