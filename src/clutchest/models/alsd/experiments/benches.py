"""The benches of [ID08]'s experiments, and what signals look like on each."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from clutchest.models.alsd.bench_forms import FORMS
from clutchest.models.experiments import Benches, BenchRecord, BenchSection
from clutchest.signals import Floats

GRID = 0.02  # s
REST = 0.4  # s without current and motion that part two runs
MOVES = 5.0  # standard deviations of the angle, or this many hundredths of a radian
PRESSED = 0.1  # Nm of motor torque beyond friction and spring: something is compressed
TURNS = 60.0  # rad: no ball ramp goes as far
TRANSMITTED = 100.0  # Nm, of a measured torque: the clutch is there and pressed
ENERGISED = 1.0  # s of current without what it should bring about
WHOLE = ("rig", "car")
BEHIND = -10.0  # rad: nor does a motor that hits the end of the grooves spring back as far


def guess(record: BenchRecord) -> tuple[BenchSection, ...]:
    """Sections of a record, from rest to rest, by how far the motor turns for what torque."""
    if not record.lacks(("wheel_speed_left",)):
        return _whole(record, "car")
    if record.lacks(("motor_angle", "armature_current")):
        return _whole(record, "rig")
    time, angle, current = _gridded(record)
    if np.ptp(angle) > TURNS or np.min(angle) < BEHIND:
        return _whole(record, "motor-alone")
    sections: list[BenchSection] = []
    for start, stop in _runs(record, angle, current):
        rows = slice(start, stop)
        if (bench := _bench(record, angle[rows], current[rows])) is None:
            continue
        if sections and sections[-1].bench == bench:
            begin = sections.pop().start
        else:
            begin = float(time[start])
        sections.append(BenchSection(begin, float(time[stop - 1]) + GRID, bench))
    return tuple(sections)


def _whole(record: BenchRecord, bench: str) -> tuple[BenchSection, ...]:
    times = [s.time for s in record.signals.values() if len(s)]
    end = max(float(t[-1]) for t in times) + 1e-6
    return (BenchSection(min(float(t[0]) for t in times), end, bench),)


def _gridded(record: BenchRecord) -> tuple[Floats, Floats, Floats]:
    """Common times, angle and current there."""
    angle, current = (record.signals[name] for name in ("motor_angle", "armature_current"))
    begin, end = max(angle.time[0], current.time[0]), min(angle.time[-1], current.time[-1])
    time = np.arange(begin, end, GRID)
    return time, angle.at(time), current.at(time)


def _runs(record: BenchRecord, angle: Floats, current: Floats) -> list[tuple[int, int]]:
    """Rows (start, stop) from one long rest to the next, half of each rest on either side."""
    noise = record.noise
    still = np.abs(np.diff(angle, prepend=angle[0])) < MOVES * np.sqrt(2) * noise["motor_angle"]
    idle = still & (np.abs(current) < MOVES * noise["armature_current"])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], idle.astype(int), [0]])))
    rests = edges.reshape(-1, 2)
    long = rests[np.ptp(rests, axis=1) * GRID >= REST] if len(rests) else rests
    cuts = sorted({0, len(angle), *(int(row.mean()) for row in long)})
    return list(pairwise(cuts))


def _bench(record: BenchRecord, angle: Floats, current: Floats) -> str | None:
    """That of one run; None where nothing happens in it."""
    p = record.parameters
    torque = p["torque_constant"] * np.abs(current)
    breaks = 2.0 * p["motor_static_torque"]
    reach, most = float(np.ptp(angle)), float(torque.max(initial=0.0))
    moved = reach > max(2 * MOVES * record.noise["motor_angle"], 0.01 * MOVES)
    if not moved:
        return "rotor-held" if most > breaks else None
    play = p["gear_ratio"] * p["gear_backlash"]
    contact = play + p["gear_ratio"] * p["ball_ramp_ratio"] * p["free_play"]
    soft = p["ball_ramp_stiffness"] / p["gear_ratio"] ** 2  # Nm/rad of the ball ramp alone
    if most > PRESSED + breaks and reach < play + 1.5 * most / soft and reach < contact:
        return "output-fixed"
    far = angle - np.min(angle) > 1.5 * contact
    if far.any() and float(np.median(torque[far])) < PRESSED:
        return "no-pack"
    return "rig"


def out_of_place(record: BenchRecord) -> tuple[BenchSection, ...]:
    """Sections that cannot be of the whole differential: no torque passes the clutch, and either
    the motor turns as no ball ramp lets it, or a current that would turn it does not, or it meets
    nothing far beyond where the pack should be."""
    if record.lacks(("motor_angle", "armature_current")):
        return ()
    apart = (s for s in guess(record) if s.bench not in WHOLE)
    return tuple(s for s in apart if _certain(record.between(s.start, s.end), s.bench))


def _certain(record: BenchRecord, bench: str) -> bool:
    sensors = [n for n in ("clutch_torque", "shaft_torque") if not record.lacks((n,))]
    if any(np.abs(record.signals[name].value).max() > TRANSMITTED for name in sensors):
        return False
    p, (time, angle, current) = record.parameters, _gridded(record)
    torque = p["torque_constant"] * np.abs(current)
    if bench == "rotor-held":
        energised = np.count_nonzero(torque > 2.0 * p["motor_static_torque"])
        return bool(GRID * energised >= ENERGISED)
    if bench == "no-pack":
        reach = p["ball_ramp_ratio"] * p["free_play"] + p["gear_backlash"]
        far = angle - np.min(angle) > 1.5 * p["gear_ratio"] * reach
        return float(torque[far].max(initial=0.0)) < PRESSED
    return len(time) * GRID >= ENERGISED


BENCHES = Benches(
    {
        "rotor-held": "the motor's rotor is held",
        "motor-alone": "the motor without its gear",
        "no-pack": "the clutch pack is removed",
        "output-fixed": "the output of the ball ramp is held",
        "rig": "the whole differential on the rig",
        "car": "the whole differential in a car",
    },
    guess,
    out_of_place,
    FORMS,
)
