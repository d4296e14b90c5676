"""Constants of the active limited-slip differential, under the names that vehicle files use."""

from __future__ import annotations

from clutchest.models.symbols import Parameter

PARAMETERS = (
    Parameter(
        "armature_resistance",
        "Ω",
        "R_a",
        "armature resistance at its reference",
        1e-3,
        plausible=(0.01, 20.0),
    ),
    Parameter(
        "armature_inductance",
        "H",
        "L_a",
        "armature inductance at its reference",
        1e-6,
        plausible=(1e-06, 0.05),
    ),
    Parameter("back_emf_constant", "V s", "K_v", "voltage constant", 1e-4, plausible=(0.001, 1.0)),
    Parameter(
        "torque_constant",
        "Nm/A",
        "K_t",
        "torque constant at its reference",
        1e-4,
        plausible=(0.001, 1.0),
    ),
    Parameter(
        "resistance_temp_coefficient",
        "1/K",
        "α_R",
        "of the armature's resistance",
        plausible=(0.0, 0.01),
    ),
    Parameter("inductance_temp_coefficient", "1/K", "α_L", "of the armature's inductance"),
    Parameter(
        "torque_constant_temp_coefficient",
        "1/K",
        "α_Kt",
        "of the torque constant",
        plausible=(-0.01, 0.005),
    ),
    Parameter(
        "armature_reference_temp",
        "°C",
        "ϑ_a,ref",
        "where R_a, L_a and K_t hold",
        plausible=(-20.0, 150.0),
    ),
    Parameter("supply_voltage", "V", "U", "largest armature voltage", 0.1, plausible=(4.0, 100.0)),
    Parameter(
        "motor_inertia",
        "kg m^2",
        "J_1",
        "motor with gear, at the motor",
        1e-7,
        plausible=(1e-07, 0.01),
    ),
    Parameter(
        "motor_coulomb_torque",
        "Nm",
        "T_C",
        "motor's Coulomb friction",
        1e-5,
        plausible=(0.0001, 1.0),
    ),
    Parameter(
        "motor_static_torque", "Nm", "T_S", "motor's static friction", 1e-5, plausible=(0.0001, 2.0)
    ),
    Parameter("motor_stribeck_speed", "rad/s", "ω_str", "motor's Stribeck speed", 1e-3),
    Parameter("motor_stribeck_exponent", "1", "δ", "motor's Stribeck exponent", 0.1),
    Parameter("motor_bristle_stiffness", "Nm/rad", "σ_0", "of the motor's friction", 1e-3),
    Parameter("motor_bristle_damping", "Nm s", "σ_1", "of the motor's friction", 0.0),
    Parameter(
        "motor_viscous", "Nm s", "σ_2", "motor's viscous friction", 0.0, plausible=(0.0, 0.05)
    ),
    Parameter("gear_ratio", "1", "K_g1", "motor to ball ramp", 1e-3, plausible=(1.0, 500.0)),
    Parameter(
        "gear_backlash",
        "rad",
        "α_b1",
        "half the play, at the gearbox output",
        0.0,
        plausible=(0.0, 0.2),
    ),
    Parameter(
        "ball_ramp_ratio",
        "rad/m",
        "K_br",
        "ball ramp, angle per travel",
        1.0,
        plausible=(50.0, 50000.0),
    ),
    Parameter(
        "ball_ramp_stiffness",
        "Nm/rad",
        "c_1",
        "ball ramp's torsional stiffness",
        1e-3,
        plausible=(1.0, 5000.0),
    ),
    Parameter(
        "ball_ramp_friction",
        "1",
        "μ_b",
        "ball ramp's coefficient of friction",
        0.0,
        plausible=(0.0, 0.2),
    ),
    Parameter("ball_ramp_bore", "m", "d", "bore of its bearings", 1e-4, plausible=(0.005, 0.3)),
    Parameter("ball_ramp_bristle_stiffness", "Nm/rad", "σ_0.br", "of its friction", 1e-3),
    Parameter("ball_ramp_exponent", "1", "i", "shape of its Dahl friction", 0.1),
    Parameter("limiter_stiffness", "N/m", "c_lim", "stop of the press plate", 1.0),
    Parameter(
        "spring_young",
        "Pa",
        "E",
        "reset spring's modulus of elasticity",
        1.0,
        plausible=(50000000000.0, 300000000000.0),
    ),
    Parameter("spring_poisson", "1", "μ", "reset spring's Poisson number", 0.0, 0.5),
    Parameter(
        "spring_outer_diameter", "m", "D", "reset spring outside", 1e-3, plausible=(0.02, 0.5)
    ),
    Parameter(
        "spring_inner_diameter", "m", "d", "reset spring inside", 1e-3, plausible=(0.01, 0.4)
    ),
    Parameter(
        "spring_thickness", "m", "t", "reset spring's thickness", 1e-4, plausible=(0.0002, 0.02)
    ),
    Parameter(
        "spring_cone_height",
        "m",
        "h",
        "reset spring's free cone height",
        0.0,
        plausible=(0.0, 0.03),
    ),
    Parameter(
        "spring_preload",
        "m",
        "s_0",
        "reset spring's displacement at rest",
        0.0,
        plausible=(0.0, 0.03),
    ),
    Parameter(
        "free_play", "m", "x_fp", "free play of the clutch pack", 0.0, plausible=(0.0, 0.005)
    ),
    Parameter(
        "pack_stiffness",
        "N/m",
        "c_cl.e",
        "equivalent stiffness of the pack",
        1.0,
        plausible=(1000000.0, 100000000000.0),
    ),
    Parameter("axial_damping", "N s/m", "d_e", "squeeze film", 1.0, plausible=(10.0, 100000000.0)),
    Parameter("friction_coefficient", "1", "μ", "clutch friction", 1e-3, plausible=(0.02, 0.6)),
    Parameter(
        "friction_surfaces", "1", "N_f", "number of friction surfaces", 1.0, plausible=(1.0, 60.0)
    ),
    Parameter(
        "equivalent_radius",
        "m",
        "r_e",
        "equivalent radius of the discs",
        1e-3,
        plausible=(0.01, 0.3),
    ),
    Parameter(
        "torsional_stiffness",
        "Nm/rad",
        "σ_0.c",
        "clutch and structure together",
        1.0,
        plausible=(100.0, 5000000.0),
    ),
    Parameter(
        "torsional_damping",
        "Nm s/rad",
        "σ_1.c",
        "of the clutch's bristle",
        0.0,
        plausible=(0.0, 100000.0),
    ),
    Parameter("clutch_static_ratio", "1", "T_S/T_C", "of the clutch, for the LuGre law", 1e-3),
    Parameter("clutch_stribeck_speed", "rad/s", "ω_s", "of the clutch, for the LuGre law", 1e-4),
    Parameter(
        "final_drive_ratio", "1", "K_g2", "servo motor to clutch", 1e-3, plausible=(0.1, 30.0)
    ),
    Parameter(
        "structure_inertia",
        "kg m^2",
        "J_2",
        "servo motor with structure",
        1e-5,
        plausible=(0.001, 50.0),
    ),
    Parameter("case_inertia", "kg m^2", "J_2'", "differential case, where it stands apart", 1e-5),
    Parameter("differential_backlash", "rad", "α_b2", "half the play, at the clutch", 0.0),
    Parameter("structure_stiffness", "Nm/rad", "c_2", "structure, where it stands apart", 1.0),
    Parameter("driveline_friction", "Nm", "T_f2", "driveline friction at the servo motor", 0.0),
    Parameter(
        "halfshaft_stiffness",
        "Nm/rad",
        "k_hs",
        "one half-shaft of the car",
        1.0,
        plausible=(100.0, 1000000.0),
    ),
    Parameter(
        "pack_heat_capacity",
        "J/K",
        "C_p",
        "heat capacity of the pack",
        1.0,
        plausible=(50.0, 100000.0),
    ),
    Parameter("pack_oil_conductance", "W/K", "G_p", "pack to oil", 0.0, plausible=(0.1, 5000.0)),
    Parameter(
        "armature_heat_capacity",
        "J/K",
        "C_a",
        "heat capacity of the armature",
        0.1,
        plausible=(1.0, 5000.0),
    ),
    Parameter(
        "armature_conductance", "W/K", "G_a", "armature to oil", 0.0, plausible=(0.01, 100.0)
    ),
    Parameter("current_proportional", "V/A", "K_R", "current controller", 1e-6),
    Parameter("current_integral", "V/(A s)", "K_I", "current controller", 0.0),
    Parameter("servo_proportional", "Nm s/rad", "K_R2", "slip speed controller", 1e-6),
    Parameter("servo_integral", "Nm/rad", "K_I2", "slip speed controller", 0.0),
    Parameter("servo_torque_limit", "Nm", "T_m2,max", "largest servo torque", 0.0),
)
