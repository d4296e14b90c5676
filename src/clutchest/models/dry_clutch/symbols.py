"""What the dry clutch is made of: states, inputs, sensors and canonical columns."""

from __future__ import annotations

from clutchest.models.declarations import Separation
from clutchest.models.symbols import Column, Input, Magnitude, Sensor, State

METAL = (-60.0, 1150.0)  # °C, from the coldest night to where cast iron melts
RUNNING = 30.0  # rad/s; an engine that turns slower has stalled, or is being started

STATES = (
    State(
        "temp_body",
        "°C",
        "T_b",
        "flywheel and pressure plate",
        0.02,
        15.0,
        25.0,
        "a standstill with the actuator retracted",
        0.15,
        restart_std=40.0,
        possible=METAL,
    ),
    State(
        "temp_housing",
        "°C",
        "T_h",
        "clutch housing",
        0.02,
        12.0,
        25.0,
        "a long cool-down with the actuator retracted",
        0.15,
        restart_std=25.0,
        possible=METAL,
    ),
    State(
        "temp_disc",
        "°C",
        "T_d",
        "friction disc",
        0.1,
        15.0,
        40.0,
        "a slip, or the actuator retracted right after one",
        0.3,
        restart_std=50.0,
        possible=METAL,
    ),
    State(
        "zero_position",
        "mm",
        "x0_ref",
        "closed slave position at T_ref; wear lowers it",
        1e-5,
        0.2,
        0.12,
        "the actuator fully retracted at a known temperature",
        slip_noise=1e-5,
        prior="zero_position_ref",
    ),
    State(
        "friction",
        "1",
        "μ/μ_0",
        "torque relative to the curve",
        5e-4,
        0.1,
        0.05,
        "a launch: torque through a slipping clutch",
        healthy_std=0.02,
        drift=1.0,
        possible=(0.02, 2.5),
    ),
    State(
        "engine_speed",
        "rad/s",
        "ω_e",
        "engine speed",
        0.3,
        5.0,
        5.0,
        "any sample of the engine speed",
        carried=False,
        possible=(-20.0, 1000.0),
    ),
    State(
        "torque_bias",
        "Nm",
        "M_bias",
        "reported engine torque less the true one",
        1.0,
        30.0,
        25.0,
        "an open clutch with changing engine speed",
        carried=False,
        healthy_std=5.0,
        drift=1.0,
    ),
    State(
        "wear_rate",
        "mm/MJ",
        "w",
        "wear per slip energy",
        0.0,
        0.05,
        0.01,
        "about 10 MJ of slip energy, and the actuator retracted before and after",
        healthy_std=0.0,
    ),
)

# What takes the place of the reported torque where no signal has it: anything from none to the
# largest, whose standard deviation is 1/√12.
ENGINE_LOAD = State(
    "engine_load",
    "1",
    "M_e/M_e,max − ½",
    "engine torque over the largest, less one half",
    0.0,
    0.29,
    0.1,
    "a reported engine torque",
    carried=False,
    role="constant",
    possible=(-1.0, 1.0),
)

INPUTS = (
    Input("engine_torque", "Nm", "M_e", "reported engine torque, net at the flywheel", smooth=True),
    Input("input_shaft_speed", "rad/s", "ω_i", "gearbox input shaft", smooth=True),
    Input("slave_position", "mm", "x + x_origin", "slave piston, raw reading", smooth=True),
    Input("coolant_temp", "°C", "T_coolant", "engine coolant", default=85.0, gap=60.0),
    Input("ambient_temp", "°C", "T_amb", "ambient air", default=20.0, gap=600.0),
    Input("vehicle_speed", "m/s", "v", "vehicle speed", default=0.0, gap=5.0),
    Input("engine_acceleration", "rad/s^2", "dω_e/dt", "slope of the measured engine speed"),
)

# Canonical columns that a vehicle may map; `engine_acceleration` is made from the engine speed.
COLUMNS = (
    Column(
        "engine_speed",
        "rad/s",
        rests=True,
        spn=190,
        named=r"^(eng|mot|crank)\w*?(speed|spd|rpm|drehzahl|_n_|_n$)|^rpm$|^n_?(eng|mot|ice)"
        r"|(speed|spd|rpm|n)_?(eng|mot|ice)|drehzahl_?(mot|kurbel)|(r[eé]gim[ea]n?|vitesse|giri|velocidad"
        r"|revoluciones|rota[cç][aã]o|obroty)_?(du_?|del_?|do_?)?(mot|silnik)|motor(varvtal|toeren)",
        magnitude=Magnitude((45.0, 1300.0), 350.0),
        noisiest=10.0,
    ),
    Column(
        "input_shaft_speed",
        "rad/s",
        rests=True,
        spn=161,
        named=r"(input|turbine|gearbox_?in|trnain|clutch_?out)\w*(speed|spd|rpm|_w_|_n_)"
        r"|^n_?(in|turb|gbx_?in|getr)|getriebeeingang|arbre_(primaire|d_?entr)|eje_(primario|entrada)"
        r"|albero_(primario|ingresso)|ing[aå]ende_?axel|ingaande_?as|wa[lł]ek_wej",
        geared_by="engine_speed",
        magnitude=Magnitude((0.0, 1300.0)),
        noisiest=10.0,
    ),
    Column(
        "slave_position",
        "mm",
        named=r"(slave|release|bearing|clutch_?(pos|travel))\w*(pos|travel|$)"
        r"|^[xs]_?(slave|clutch|kuppl)|nehmerzylinder|ausr(ue|[uü])cker|kupplungsweg"
        r"|cylindre_r[eé]cepteur|but[eé]e_embray|cilindro_(esclavo|ricevitore)|kopplings(l[aä]ge|v[aä]g)",
        magnitude=Magnitude((0.1, 300.0)),
        noisiest=1.0,
    ),
    Column(
        "motor_position",
        "mm",
        rests=True,
        named=r"(motor|actuator)\w*(pos|travel)|^[xs]_?(mot|act)|stellmotor",
        magnitude=Magnitude((0.1, 300.0)),
        noisiest=2.0,
    ),
    Column(
        "engine_torque",
        "Nm",
        spn=513,
        named=r"(eng|crank|trnain|mot)\w*(torque|trq|tq|moment)\w*(act|net|meas)"
        r"|actual\w*engine\w*torque|^(m|t|trq|tq)_?(eng|mot|ice)|(motor|kurbel)(dreh)?moment|motorvridmoment"
        r"|couple_?(du_?)?moteur|(par|torque|coppia|koppel|moment)_?(del_?|do_?)?(mot|eng|silnik)"
        r"|^(engine|eng|motor|mot)_?(torque|trq|tq)$",
        companions={"fraction": 4154, "friction": 514},
        reference_spn=544,
        magnitude=Magnitude((0.04, 2.0), of="engine_torque_max", moves="engine_speed"),
        noisiest=300.0,
    ),
    Column(
        "coolant_temp",
        "°C",
        possible=(-50.0, 130.0, 3.0),
        spn=110,
        named=r"(coolant|cool|clnt|k(ue|ü)hl|water)\w*(temp|_te_|_t$)"
        r"|(^t|temp\w*)_?(cool|kmt|water|k(ue|ü)hl|wasser|refrig|eau|acqua|kylv|koelw|ch[lł]odz)"
        r"|liquide_?refroid",
        noisiest=10.0,
    ),
    Column(
        "ambient_temp",
        "°C",
        possible=(-60.0, 60.0, 2.0),
        spn=171,
        named=r"(amb|outside|au(ss|ß)en|airamb|umgebung)\w*(temp|_te_|_t$)"
        r"|(^t|temp\w*)_?(amb|out|au(ss|ß)en|umg|ext|est|ute|omg|buiten|zewn)",
        noisiest=10.0,
    ),
    Column(
        "vehicle_speed",
        "m/s",
        rests=True,
        spn=84,
        named=r"(veh|vehicle)\w*(speed|spd|_v_)|^speed$|^v$|^v_?(veh|fzg)|geschwindigkeit|vitesse|velocidad|velocit[aà]"
        r"|velocidade|hastighet|snelheid|pr[eę]dko[sś][cć]",
        magnitude=Magnitude((0.0, 70.0)),
        noisiest=3.0,
    ),
    Column(
        "engine_torque_demand",
        "Nm",
        rests=True,
        spn=512,
        named=r"driver\w*(dem|req|wish)\w*(torque|trq|tq)|(torque|trq|tq)\w*driver",
        reference_spn=544,
    ),
    Column("engine_torque_request", "Nm", rests=True, spn=518, reference_spn=544),
    Column(
        "accelerator_pedal",
        "%",
        rests=True,
        spn=91,
        named=r"(acc(el)?(erator)?|gas)_?(pedal|ped)\w*|^app(s)?(_|$)"
        r"|fahrpedal|p[eé]dale_acc|acelerador|acceleratore",
    ),
)

# The zero position informs the body's temperature by a coefficient that is itself uncertain, and a
# filter of first order neglects the product of both errors.  White readings, 100 a second, would be
# more precise than that product and make the body's temperature wrong by three standard deviations
# after it was heated.
SENSORS = (
    Sensor("engine_speed", "rad/s", "ω_e", "engine speed", tolerance=4.0, least=RUNNING),
    Sensor(
        "zero_position",
        "mm",
        "x0",
        "slave position while the actuator is fully retracted",
        column="slave_position",
        mode="retracted",
        repeats=0.08,
        tolerance=8.0,  # a body that loses heat to the gearbox: 5
    ),
)


# Pairs of states that one kind of measurement informs together, and the manoeuvre that separates
# them.
SEPARATING_MANOEUVRES = (
    Separation(("temp_body", "zero_position"), "slow cooling with the actuator retracted"),
    Separation(("temp_disc", "zero_position"), "slow cooling with the actuator retracted"),
    Separation(("temp_housing", "zero_position"), "slow cooling with the actuator retracted"),
    Separation(("temp_housing", "temp_body"), "a long cool-down with the actuator retracted"),
    Separation(("temp_disc", "temp_body"), "a slip, which heats the disc first"),
    Separation(
        ("friction", "zero_position"), "the actuator retracted, which shows the position alone"
    ),
    Separation(("friction", "torque_bias"), "an open clutch, which shows the bias alone"),
    Separation(
        ("wear_rate", "zero_position"), "more slip, with the actuator retracted before and after"
    ),
)
