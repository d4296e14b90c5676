"""Constants of the truck's dry clutch, under the names that vehicle files use."""

from __future__ import annotations

from clutchest.models.symbols import Parameter

PARAMETERS = (
    Parameter(
        "heat_capacity_body",
        "J/K",
        "(m c_p)_b",
        "heat capacity of the body",
        1.0,
        plausible=(1000.0, 400000.0),
    ),
    Parameter(
        "heat_capacity_housing",
        "J/K",
        "(m c_p)_h",
        "heat capacity of the housing",
        1.0,
        plausible=(500.0, 200000.0),
    ),
    Parameter(
        "heat_capacity_disc",
        "J/K",
        "(m c_p)_d",
        "heat capacity of the disc",
        1.0,
        plausible=(50.0, 20000.0),
    ),
    Parameter(
        "conductance_engine_body",
        "W/K",
        "k_ICE2b",
        "engine block to body",
        0.0,
        plausible=(0.1, 500.0),
    ),
    Parameter(
        "conductance_body_housing", "W/K", "k_b2h", "body to housing", 0.0, plausible=(0.1, 500.0)
    ),
    Parameter(
        "conductance_housing_ambient",
        "W/K",
        "k_h2amb",
        "housing to ambient air",
        0.0,
        plausible=(0.1, 300.0),
    ),
    Parameter(
        "conductance_disc_body", "W/K", "k_d2b", "disc to body", 1e-3, plausible=(1.0, 2000.0)
    ),
    Parameter(
        "heat_fraction_body", "1", "k_P", "share of the slip power that enters the body", 0.0, 1.0
    ),
    Parameter(
        "expansion_body",
        "mm/K",
        "k_exp,1",
        "zero position per body temperature",
        plausible=(-0.05, 0.1),
    ),
    Parameter(
        "expansion_disc",
        "mm/K",
        "k_exp,2",
        "zero position per disc over body temperature",
        plausible=(-0.05, 0.1),
    ),
    Parameter(
        "reference_temp",
        "°C",
        "T_ref",
        "temperature at which the torque curve holds",
        plausible=(-20.0, 200.0),
    ),
    Parameter(
        "disc_body_temp_cap",
        "K",
        "ΔT_cap",
        "T_d − T_b above which the disc expands no further",
        0.0,
        plausible=(10.0, 600.0),
    ),
    Parameter(
        "zero_position_ref",
        "mm",
        "x0_ref",
        "nominal zero position at T_ref",
        plausible=(-20.0, 150.0),
    ),
    Parameter(
        "position_origin", "mm", "x_origin", "sensor reading at x = 0", plausible=(-20.0, 150.0)
    ),
    Parameter(
        "torque_cubic",
        "Nm/mm^3",
        "a",
        "cubic term of the torque curve",
        upper=0.0,
        plausible=(-1000.0, -0.01),
    ),
    Parameter(
        "torque_quadratic",
        "Nm/mm^2",
        "b",
        "quadratic term of the torque curve",
        0.0,
        plausible=(0.1, 1000.0),
    ),
    Parameter("kiss_point", "mm", "x_ISP", "incipient sliding point", plausible=(0.5, 40.0)),
    Parameter(
        "engine_inertia", "kg m^2", "J_e", "engine with flywheel", 1e-3, plausible=(0.02, 20.0)
    ),
    Parameter(
        "engine_torque_max", "Nm", "M_e,max", "largest engine torque", 1.0, plausible=(30.0, 8000.0)
    ),
)
