"""What a driver does in each scenario of the truck, in words."""

from __future__ import annotations

from collections.abc import Mapping

_LAUNCH = (
    "once a minute pull away in 2nd to 7th gear, the truck loaded (30 to 42 t), with 630 to 880 "
    "rpm and the clutch slipping for 1 to 4 s, every fourth time in a higher gear than needed; "
    "drive for 14 to 22 s, stop, and stand for half a minute in neutral with the clutch closed"
)
MANOEUVRES: Mapping[str, str] = {
    "city": "for 25 minutes drive in town: some 16 times pull away in 2nd to 6th gear with 650 to "
    "840 rpm and the clutch slipping for 1 to 3 s, go on at 15 to 80 km/h, stop, and stand for 10 "
    "to 40 s in neutral with the clutch closed",
    "launches": f"for 25 minutes, {_LAUNCH}",
    "ramps": "with the gearbox's input shaft held and the engine at 1440 rpm, move the clutch from "
    "wide open (12 mm) to nearly closed (4.15 mm) in 5 s and back in 5 s, 15 strokes without a "
    "pause; then stand for two and a half minutes in neutral with the clutch closed",
    "heating": "four times, ten minutes apart, with the input shaft at 570 rpm: nine times close "
    "the clutch to some 500 Nm for 3 s with the engine 100 rpm faster, then six times to 1450 Nm "
    "for half a second with it 500 rpm faster, then three times the same with it 150 rpm faster; "
    "in between stand in neutral with the clutch closed",
    "slip-steps": "six times, every one and a half minutes: with the input shaft held, close the "
    "clutch to 1 mm past its kiss point and leave it there while the engine goes from 600 to "
    "1300 rpm and back in eight steps of 1.2 s; in between stand in neutral with the clutch closed",
    "cooldown": "begin with a hot clutch (some 110 °C), slip it once for a minute at 145 Nm with "
    "the input shaft held and the engine at 1240 rpm, then idle for 40 minutes in neutral with the "
    "clutch closed",
    "pulses": "for 23 minutes, every 100 s: with the engine at 1190 rpm and the input shaft 210 to "
    "380 rpm slower, close the clutch six times for 5 s to 250 to 560 Nm and open it for 4 s; in "
    "between stand for 40 s in neutral with the clutch closed",
    "mixed": "for 20 minutes, 3 to 5 minutes each of town driving, of launches once a minute, of "
    "the clutch held at one position while the engine goes from 600 to 1300 rpm, and of torque "
    "pulses of 5 s",
    "cold-start": f"from a cold start on, for 15 minutes, {_LAUNCH}",
    "closed": "cruise in top gear at 74 to 85 km/h for half an hour without opening the clutch",
}
