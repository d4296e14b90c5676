"""What is done on the rig or the road in each scenario of the differential, in words."""

from __future__ import annotations

from collections.abc import Mapping

MANOEUVRES: Mapping[str, str] = {
    "rig-steps": "with 25 rpm of slip, for a minute: current steps of 12, 7 and 2.5 A and values "
    "in between, held for 1 s, 1 s apart",
    "rig-slow": "with 0.5 rpm of slip: four current steps of 12 A, held for 2.6 s, 1.8 s apart",
    "rig-ramps": "with 2 rpm of slip: current ramps to 20 A and back at 20, 15, 10, 5 and 1 A/s",
    "slip-oil-sweep": "for two minutes: slip from 0.5 to 120 rpm and back every 20 s while the oil "
    "warms from -20 to 120 °C and cools again, with current pulses of 2.5 to 9 A for 1.2 s every "
    "2.2 s",
    "coast": "for a minute with the clutch open: slip from 0 to 120 rpm and back in both "
    "directions while the oil warms from 10 to 90 °C, with one current pulse every 20 s",
    "car": "for two minutes at 15 to 90 km/h: corners and split friction, with the clutch asked to "
    "lock (2 to 11 A, 1 to 4 s) every 5 s",
    "I1": "rotor held: voltages of ±0.8, ±1.6 and ±2.4 V for 2 s each while the rig warms from 5 "
    "to 115 °C within ten minutes",
    "I2": "rotor held: voltage steps of 2, 4 and 6 V for a quarter of a second",
    "I3": "motor alone: voltages of ±3, ±6, ±9 and ±12 V for 2 s each",
    "I4": "rotor held by a torque sensor: currents of ±2, ±5 and ±8 A for 2 s each while the rig "
    "warms from 5 to 115 °C within ten minutes",
    "I5": "motor alone: start it every 2 s by 1, 1.5 and 2 A for a third of a second, then let the "
    "current rise by 0.3 A/s from rest until it breaks away",
    "I6": "without the clutch pack: turn the motor up to 30 rad and back at 4 rad/s",
    "I7": "current ramps to 18 A and back at 15 A/s, three with the pack, three with the output of "
    "the ball ramp fixed",
    "I8": "clutch locked by 15 A: a sine of 250 Nm at 0.5 Hz by the servo motor",
}
