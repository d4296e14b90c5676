"""Names of common J1939 parameter groups and parameters, for logs without a database.

Source: SAE J1939-71 and J1939-73, numbers and what they stand for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ParameterGroup:
    """A parameter group: ``acronym``, ``words``, and SPN → name of parameters in it."""

    acronym: str
    words: str
    parameters: Mapping[int, str]


def _group(acronym: str, words: str, **parameters: str) -> ParameterGroup:
    return ParameterGroup(acronym, words, {int(k[1:]): v for k, v in parameters.items()})


GROUPS: Mapping[int, ParameterGroup] = {
    0: _group(
        "TSC1",
        "torque/speed control",
        _518="requested torque",
        _695="override control mode",
        _898="requested speed",
    ),
    59392: _group("ACKM", "acknowledgement"),
    59904: _group("RQST", "request"),
    60160: _group("TP.DT", "transport protocol, data"),
    60416: _group("TP.CM", "transport protocol, connection management"),
    60928: _group("AC", "address claimed"),
    61184: _group("PropA", "proprietary A"),
    61440: _group(
        "ERC1",
        "electronic retarder controller 1",
        _520="actual retarder torque",
        _900="retarder torque mode",
    ),
    61441: _group(
        "EBC1",
        "electronic brake controller 1",
        _521="brake pedal position",
        _563="ABS active",
        _1121="EBS brake switch",
    ),
    61442: _group(
        "ETC1",
        "electronic transmission controller 1",
        _161="input shaft speed",
        _191="output shaft speed",
        _522="clutch slip",
        _560="driveline engaged",
        _573="torque converter lock-up engaged",
        _574="shift in process",
    ),
    61443: _group(
        "EEC2",
        "electronic engine controller 2",
        _91="accelerator pedal position 1",
        _92="engine load at current speed",
        _558="accelerator pedal 1 low idle switch",
        _559="kickdown switch",
    ),
    61444: _group(
        "EEC1",
        "electronic engine controller 1",
        _190="engine speed",
        _512="driver's demand engine torque",
        _513="actual engine torque",
        _899="engine torque mode",
        _2432="engine demand torque",
        _4154="actual engine torque, fraction",
    ),
    61445: _group(
        "ETC2",
        "electronic transmission controller 2",
        _523="current gear",
        _524="selected gear",
        _526="actual gear ratio",
    ),
    61449: _group(
        "VDC2",
        "vehicle dynamic stability control 2",
        _1807="steering wheel angle",
        _1808="yaw rate",
        _1809="lateral acceleration",
        _1810="longitudinal acceleration",
    ),
    64914: _group("EOI", "engine operating information", _3543="engine operating state"),
    65110: _group("AT1T1I", "aftertreatment 1 DEF tank 1", _1761="DEF tank level"),
    65132: _group(
        "TCO1",
        "tachograph",
        _1623="tachograph output shaft speed",
        _1624="tachograph vehicle speed",
    ),
    65134: _group(
        "HRW",
        "high resolution wheel speed",
        _1592="front left wheel speed",
        _1593="front right wheel speed",
        _1594="rear left wheel speed",
        _1595="rear right wheel speed",
    ),
    65170: _group("EI1", "engine information 1"),
    65198: _group("AIR1", "air supply pressure", _46="pneumatic supply pressure"),
    65203: _group("LFI", "fuel information, liquid"),
    65215: _group("EBC2", "wheel speed information", _904="front axle speed"),
    65217: _group(
        "VDHR",
        "high resolution vehicle distance",
        _917="total vehicle distance",
        _918="trip distance",
    ),
    65226: _group("DM1", "active trouble codes", _1214="suspect parameter", _1215="failure mode"),
    65227: _group("DM2", "previously active trouble codes"),
    65228: _group("DM3", "clearing of previously active trouble codes"),
    65235: _group("DM11", "clearing of active trouble codes"),
    65236: _group("DM12", "emission-related active trouble codes"),
    65247: _group(
        "EEC3",
        "electronic engine controller 3",
        _514="nominal friction torque",
        _515="engine's desired operating speed",
    ),
    65248: _group("VD", "vehicle distance", _244="trip distance", _245="total vehicle distance"),
    65249: _group("RC", "retarder configuration"),
    65250: _group("TCFG", "transmission configuration"),
    65251: _group(
        "EC1",
        "engine configuration 1",
        _188="engine speed at idle",
        _539="engine torque at idle",
        _544="engine reference torque",
    ),
    65252: _group("SHUTDN", "shutdown"),
    65253: _group("HOURS", "engine hours", _247="total engine hours", _249="total revolutions"),
    65254: _group("TD", "time and date"),
    65255: _group("VH", "vehicle hours", _246="total vehicle hours"),
    65256: _group(
        "VDS", "vehicle direction and speed", _165="compass bearing", _517="navigation speed"
    ),
    65257: _group("LFC", "fuel consumption, liquid", _182="trip fuel", _250="total fuel used"),
    65258: _group("VW", "vehicle weight", _181="cargo weight", _582="axle weight"),
    65259: _group("CI", "component identification", _586="make", _587="model", _588="serial"),
    65260: _group("VI", "vehicle identification", _237="vehicle identification number"),
    65261: _group("CCSS", "cruise control set-up", _74="highest vehicle speed"),
    65262: _group(
        "ET1",
        "engine temperature 1",
        _110="coolant temperature",
        _174="fuel temperature",
        _175="oil temperature",
    ),
    65263: _group(
        "EFL/P1", "engine fluid level and pressure 1", _98="oil level", _100="oil pressure"
    ),
    65264: _group("PTO", "power take-off", _186="power take-off speed"),
    65265: _group(
        "CCVS1",
        "cruise control and vehicle speed 1",
        _70="parking brake switch",
        _84="wheel-based vehicle speed",
        _597="brake switch",
        _598="clutch switch",
    ),
    65266: _group("LFE1", "fuel economy, liquid", _51="throttle valve position", _183="fuel rate"),
    65267: _group("VP", "vehicle position", _584="latitude", _585="longitude"),
    65268: _group("TIRE", "tyre condition", _241="tyre pressure", _242="tyre temperature"),
    65269: _group(
        "AMB",
        "ambient conditions",
        _108="barometric pressure",
        _171="ambient air temperature",
        _172="air inlet temperature",
    ),
    65270: _group(
        "IC1",
        "intake and exhaust conditions 1",
        _102="boost pressure",
        _105="intake manifold temperature",
        _173="exhaust gas temperature",
    ),
    65271: _group("VEP1", "vehicle electrical power 1", _168="battery potential"),
    65272: _group(
        "TRF1",
        "transmission fluids 1",
        _123="clutch pressure",
        _124="oil level",
        _127="oil pressure",
        _177="oil temperature",
    ),
    65274: _group("B", "brakes", _116="brake application pressure", _117="primary pressure"),
    65275: _group("RF", "retarder fluid", _120="hydraulic retarder oil temperature"),
    65276: _group("DD1", "dash display 1", _96="fuel level"),
    65279: _group("OI", "operator indicators"),
}
_PROPRIETARY_B = range(0xFF00, 0x10000)


def group_of(pgn: int) -> ParameterGroup | None:
    """The parameter group of this number, None for one that is not listed."""
    if pgn in _PROPRIETARY_B:
        return ParameterGroup("PropB", "proprietary B", {})
    return GROUPS.get(pgn)
