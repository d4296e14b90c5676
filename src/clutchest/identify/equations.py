"""Stretches of a drive over which one signal follows from others, for telling its delay.

| signal | where | equation |
|---|---|---|
| engine_torque | clutch open | M_e = J_e dω_e/dt + bias |
| input_shaft_speed | locked | ω_i = ω_e |
| vehicle_speed | locked, in gear | v = ω_e / ratio |
| slave_position | slipping | M_e − J_e dω_e/dt = cubic of x (eq. 16; its coefficients per slip) |
| motor_position | off its stop | x_m = x − what the port trapped |
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchest.estimate.timeline import regimes
from clutchest.identify.delay import Stretch
from clutchest.identify.sensor_noise import far_off
from clutchest.models.regimes import Mode, runs
from clutchest.signals import Floats, Signal, Signals
from clutchest.vehicle import Vehicle

STEP = 0.01  # s, of the common grid
SMOOTH = 0.025  # s, standard deviation of the common smoothing …
SMOOTH_SAMPLES = 1.5  # … or so many samples of the slower signal
EDGE = 0.1  # s left out at both ends of a stretch, beside what smoothing mixes in: signals that
# are late change their mode late
SETTLED = 0.5  # s away from any slip, to count as locked for good
LONGEST = 20.0  # s of one stretch
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Drive:
    """One drive on a grid of STEP s: its signals, where they have samples, and its modes."""

    vehicle: Vehicle
    signals: Mapping[str, Signal]
    time: Floats
    mode: NDArray[np.uint8]

    @classmethod
    def of(cls, signals: Signals, vehicle: Vehicle) -> Drive | None:
        """None where the engine speed is missing."""
        present = {n: _clean(s.only_valid()) for n, s in signals.items() if s.valid.sum() > 8}
        if "engine_speed" not in present:
            return None
        speed = present["engine_speed"]
        time = np.arange(speed.time[0], speed.time[-1], STEP)
        return cls(vehicle, present, time, regimes(time, present, vehicle).mode)

    def has(self, *names: str) -> bool:
        """Whether all these signals are there."""
        return all(name in self.signals for name in names)

    def raw(self, name: str) -> Floats:
        """A signal straight between its samples, on the grid."""
        return np.interp(self.time, self.signals[name].time, self.signals[name].value)

    def width(self, *names: str) -> float:
        """Smoothing in s that suits all these signals."""
        periods = [float(np.median(np.diff(self.signals[name].time))) for name in names]
        return max(SMOOTH, SMOOTH_SAMPLES * max(periods))

    def whole(self, *names: str) -> Mask:
        """Where none of these signals has a gap."""
        good = np.ones(len(self.time), bool)
        for name in names:
            stamps = self.signals[name].time
            steps = np.diff(stamps)
            after = np.clip(np.searchsorted(stamps, self.time), 1, len(stamps) - 1)
            good &= steps[after - 1] <= max(0.1, 3 * float(np.median(steps)))
            good &= (self.time >= stamps[0]) & (self.time <= stamps[-1])
        return good

    def rows(self, flag: Mask, least: float, width: float) -> list[NDArray[np.intp]]:
        """Grid rows of every stretch of ``flag`` of ``least`` s: closer than the smoothing, so that
        noise weighs alike whatever the delay."""
        edge, most = int((EDGE + 3 * width) / STEP), int(LONGEST / STEP)
        found = []
        for start, end in zip(*runs(flag), strict=True):
            for begin in range(start + edge, end - edge, most):
                stop = min(begin + most, end - edge)
                if (stop - begin) * STEP >= least:
                    found.append(np.arange(begin, stop, max(int(width / STEP / 2), 1)))
        return found


def _clean(signal: Signal) -> Signal:
    keep = ~far_off(signal.value)
    return signal.take(keep)


def _smooth(value: Floats, width: float) -> Floats:
    from scipy.ndimage import gaussian_filter1d

    smoothed: Floats = gaussian_filter1d(value, width / STEP, mode="nearest")
    return smoothed


def _slope(value: Floats) -> Floats:
    slope: Floats = np.gradient(value, STEP)
    return slope


def _stretch(
    drive: Drive,
    rows: NDArray[np.intp],
    y: Floats,
    known: Floats | None,
    own: list[Floats],
    level: bool = True,
) -> Stretch:
    """y less ``known`` at the rows, to be made of ``own`` columns, both ``delay`` s earlier;
    ``level`` gives the stretch a constant.

    Between the grid's rows all is a cubic spline: straight lines average the noise there, and
    least noise would pass for the delay.
    """
    from scipy.interpolate import CubicSpline

    part = slice(max(int(rows[0] - 1 / STEP), 0), int(rows[-1] + 1 / STEP))
    time, at = drive.time[part], drive.time[rows]
    read, courses = y[rows], [CubicSpline(time, column[part]) for column in own]
    cause = None if known is None else CubicSpline(time, known[part])

    def columns(delay: float) -> tuple[Floats, Floats]:
        left = read if cause is None else read - cause(at - delay)
        constant = [np.ones(len(at))] if level else []
        return left, np.column_stack([*constant, *(course(at - delay) for course in courses)])

    return Stretch(columns)


def engine_torque(drive: Drive, inertia: float) -> list[Stretch]:
    """Clutch open: the torque speeds the engine up, of ``inertia`` kg m².

    The inertia is given: one that is fitted reads too low under noise, and the delay then goes to
    where the engine happens to be more lively.
    """
    if not drive.has("engine_torque", "slave_position"):
        return []
    width = drive.width("engine_torque", "engine_speed")
    torque = _smooth(drive.raw("engine_torque"), width)
    needed = inertia * _slope(_smooth(drive.raw("engine_speed"), width))
    flag = (drive.mode == Mode.open) & drive.whole("engine_torque", "engine_speed")
    return [_stretch(drive, rows, torque, needed, []) for rows in drive.rows(flag, 0.3, width)]


def input_shaft_speed(drive: Drive) -> list[Stretch]:
    """Locked: both sides turn alike."""
    if not drive.has("input_shaft_speed"):
        return []
    shaft, engine, flag, width = _turning_together(drive, "input_shaft_speed")
    return [_stretch(drive, rows, shaft, engine, []) for rows in drive.rows(flag, 1.0, width)]


def vehicle_speed(drive: Drive) -> list[Stretch]:
    """Locked and in gear: the vehicle goes as fast as the engine turns."""
    if not drive.has("vehicle_speed"):
        return []
    speed, engine, flag, width = _turning_together(drive, "vehicle_speed")
    found = []
    for rows in drive.rows(flag & (speed > 1.0), 2.0, width):
        ratio = speed[rows] / np.maximum(engine[rows], 1.0)
        if np.ptp(ratio) < 0.1 * ratio.mean():  # one gear, and not out of it
            found.append(_stretch(drive, rows, speed, None, [engine], level=False))
    return found


def slave_position(drive: Drive, torque_delay: float, inertia: float) -> list[Stretch]:
    """Slipping: clutch torque is a cubic of the position; the columns are *later* here, so the
    delay comes out negative."""
    if not drive.has("engine_torque", "slave_position"):
        return []
    width = drive.width("engine_torque", "engine_speed", "slave_position")
    acceleration = _slope(_smooth(drive.raw("engine_speed"), width))
    reported = _smooth(drive.raw("engine_torque"), width)
    torque = np.interp(drive.time + torque_delay, drive.time, reported)
    p = {key: value.value for key, value in drive.vehicle.parameters.items()}
    carried = torque - inertia * acceleration
    depth = p["kiss_point"] + p["position_origin"] - drive.raw("slave_position")
    slip = drive.raw("engine_speed") - drive.raw("input_shaft_speed")
    power = np.abs(carried * slip)
    flag = (drive.mode == Mode.slipping) & (depth > 0.5)
    flag &= drive.whole("engine_torque", "engine_speed", "slave_position")
    growth = p["expansion_disc"] / p["heat_capacity_disc"]  # (15), mm/J of a short slip
    heated = np.cumsum(np.where(drive.mode == Mode.slipping, power, 0.0)) * STEP * growth
    found = []
    for side in (slip > 3.0, slip < -3.0):
        for rows in drive.rows(flag & side, 0.4, width):
            # heat moves the curve as the slip goes on: by nominal numbers, the rest is fitted
            grown = heated - heated[rows[0]]
            inside = np.maximum(depth + grown, 0.0)
            slope = inside * (2 * p["torque_quadratic"] - 3 * p["torque_cubic"] * inside)
            elapsed = drive.time - drive.time[rows[0]]
            curve = [inside, inside**2, inside**3, grown * slope, elapsed * slope]
            own = [_smooth(column, width) for column in curve]
            found.append(_stretch(drive, rows, carried, None, own))
    return found


def motor_position(drive: Drive) -> list[Stretch]:
    """Off its stop the motor moves the piston: the motor's delay less the piston's."""
    if not drive.has("motor_position", "slave_position"):
        return []
    width = drive.width("motor_position", "slave_position")
    motor = _smooth(drive.raw("motor_position"), width)
    slave = _smooth(drive.raw("slave_position"), width)
    flag = (motor > 1.0) & drive.whole("motor_position", "slave_position")
    return [_stretch(drive, rows, motor, None, [slave]) for rows in drive.rows(flag, 0.5, width)]


def _turning_together(drive: Drive, name: str) -> tuple[Floats, Floats, Mask, float]:
    """Signal ``name`` and engine speed, smoothed alike; where both are whole and the clutch is
    locked; the smoothing in s."""
    names = (name, "engine_speed")
    width = drive.width(*names)
    signal, engine = (_smooth(drive.raw(which), width) for which in names)
    return signal, engine, _locked(drive) & drive.whole(*names), width


def _locked(drive: Drive) -> Mask:
    """Locked for good: the last of a slip is over before, and the next has not begun."""
    free = (drive.mode != Mode.locked) & (drive.mode != Mode.retracted)
    near = int(SETTLED / STEP)
    counts = np.cumsum(np.concatenate([np.zeros(near + 1), free, np.zeros(near)]))
    around: Mask = counts[2 * near + 1 :] - counts[: -2 * near - 1] == 0
    return around
