"""The constants of a vehicle with unit, meaning and source; presets; parameters that faults change.

SI units; those of the thesis are converted here. Shaft speed is in rpm in ``beta``, as in every
vehicle log, and in rad/s in the motor constants.

Sources
-------
[T]  "Neural network based propulsion system fault diagnostics for the NPS AUV II", NPS thesis,
     June 1992.
[N]  NPS AUV II hydrodynamic file of the NPSNET simulator, 1995.
[H]  Healey & Lienard, "Multivariable sliding mode control for autonomous diving and steering of
     unmanned underwater vehicles", IEEE J. Oceanic Eng. 18(3), 1993, doi:10.1109/JOE.1993.236372:
     form of the speed controller.
[P]  Prestero, "Verification of a six-degree of freedom simulation model for the REMUS autonomous
     underwater vehicle", MIT and WHOI thesis, 2001.
[F]  Fossen, MSS toolbox, VESSELS/remus100.m, which takes the figures of the propeller from Allen,
     Vorus & Prestero, "Propulsion system performance enhancements on REMUS AUVs", OCEANS 2000,
     doi:10.1109/OCEANS.2000.882209.
[L]  Simulator of the Tethys-class long-range AUV by MBARI and Open Robotics, github.com/osrf/lrauv:
     tethys_equipped/model.sdf, tethys/model.sdf.in, test_state_msg.cc.
[B]  Simulator of the same vehicle, github.com/braanan/lrauv.sim: vehicle_coeffs.m.
[E]  An estimate or a default of this project, where the sources are silent.
"""

import math
from dataclasses import dataclass, field, fields
from typing import NamedTuple

from auv_fault_env.channels import CHANNELS, MAXIMUM_COMMAND, READINGS, Channel
from auv_fault_env.errors import finite_in_range, known_name, refusal

FOOT = 0.3048  # m
OUNCE_INCH = 7.061551814e-3  # N m
INCH = 0.0254  # m
SAMPLE_RATE = 10.0  # 1/s, the vehicle's data rate [T]
SAMPLE_TIME = 1.0 / SAMPLE_RATE  # s
ENERGY_WEIGHT = 0.01  # 1/J, in the reward beside the squared speed deviation [m^2/s^2]
SIDES = ("port", "starboard")
FASTEST = 20.0  # m/s, beyond the speed of any vehicle


def blade_pair_inertia(
    hub=0.010, tip=2 * INCH, chord=0.025, thickness=0.003, density=8500.0, elements=9
) -> float:
    """Polar inertia [kg m^2] of a two-bladed propeller, a sum over rectangles as in [T].

    The blade is assumed: 4 inch of brass, without entrained water.
    """
    width = (tip - hub) / elements
    radii = [hub + (k + 0.5) * width for k in range(elements)]
    mass = density * chord * thickness * width
    return 2 * sum(mass * (r * r + width * width / 12) for r in radii)


def quantity(
    value: float,
    unit: str,
    about: str,
    source: str,
    low: float,
    high: float,
    band: float = 0.0,
):
    """A field of `Vehicle`: physical limits, and half the healthy band relative to the value."""
    metadata = dict(unit=unit, about=about, source=source, low=low, high=high, band=band)
    return field(default=value, metadata=metadata)


@dataclass(frozen=True)
class Vehicle:
    """A healthy vehicle: hull, shafts and motors (all alike), water and controller gains.

    A variant is ``dataclasses.replace(PRESETS["thesis1992"], alpha=-0.1)``; a value outside its
    physical limits raises `ValueError`. `describe` lists units, meanings and sources. A vehicle
    with one of its `shafts`, 1 or 2, has that of port.
    """

    # fmt: off
    name: str = "thesis1992"
    alpha: float = quantity(
        -0.0333 / 1.35 / FOOT, "1/m", "surge drag coefficient", "T IV.C: -0.0333 1/ft is +35 %",
        -10.0, -1e-4, 0.05,
    )
    beta: float = quantity(
        2.1906e-7 / 0.65 * FOOT, "(m/s^2)/rpm^2", "thrust coefficient, all propellers together",
        "T IV.C: 2.1906e-7 (ft/s^2)/rpm^2 is -35 %", 0.0, 1e-5, 0.03,
    )
    gamma: float = quantity(
        -0.0722 / FOOT, "1/(m rad^2)", "rudder and plane drag coefficient", "N: not in the thesis",
        -100.0, 0.0,
    )
    c1: float = quantity(
        0.0465, "1", "torque coefficient at zero advance", "T III.C.3", 0.0, 1.0, 0.03,
    )
    c2: float = quantity(
        0.0285, "1", "fall of the torque coefficient with the advance ratio", "T III.C.3", 0.0, 1.0,
        0.03,
    )
    resistance: float = quantity(1.01, "ohm", "terminal resistance", "T App. A", 1e-3, 100.0, 0.02)
    torque_constant: float = quantity(
        8.67 * OUNCE_INCH, "N m/A", "torque constant K_T, and as V s/rad the back-EMF constant K_b",
        "T App. A: 8.67 oz-in/A = 0.0612; K_b is printed as 0.061", 1e-4, 10.0, 0.01,
    )
    coulomb_friction: float = quantity(
        1.79 * OUNCE_INCH, "N m", "Coulomb friction of motor and shaft", "T App. A: 1.79 oz-in",
        0.0, 10.0, 0.10,
    )
    viscous_friction: float = quantity(
        0.0, "N m s/rad", "viscous friction of motor and shaft",
        "E: Appendix A has one friction figure, taken as Coulomb", 0.0, 1.0, 0.10,
    )
    inertia: float = quantity(
        2.3e-3 * OUNCE_INCH + blade_pair_inertia(), "kg m^2", "armature and propeller",
        "T App. A: 2.3e-3 oz-in-s^2; propeller E", 1e-6, 1.0,
    )
    density: float = quantity(
        1.94 * 515.378819, "kg/m^3", "water density", "N: 1.94 slug/ft^3", 900.0, 1100.0,
    )
    diameter: float = quantity(4 * INCH, "m", "propeller diameter", "T III.B: 4 inch", 0.01, 10.0)
    wake_fraction: float = quantity(0.1, "1", "wake fraction", "T III.C.3", 0.0, 0.9)
    maximum_voltage: float = quantity(
        24.0, "V", "supply voltage", "T III.B: 0 to 24 V", 1.0, 1000.0,
    )
    maximum_current: float = quantity(
        25.0, "A", "largest current that a motor's sensor measures", "E: shunt of a common part",
        0.1, 1000.0,
    )
    maximum_speed: float = quantity(
        MAXIMUM_COMMAND, "m/s", "largest surge speed command", "E: twice the 1.5 ft/s of T",
        0.1, FASTEST,
    )
    disturbance_std: float = quantity(
        0.001, "m/s^2", "standard deviation of the disturbing acceleration",
        "E: moves the speed by about 1 cm/s at held shaft speed", 0.0, 1.0,
    )
    disturbance_time: float = quantity(
        5.0, "s", "correlation time of the disturbance", "E: swell", 0.1, 1000.0,
    )
    speed_filter_time: float = quantity(
        1.0, "s", "speed controller: time constant of the filter on the measured speed",
        "E: the paddle wheel's noise would chatter the shafts", 1e-3, 100.0,
    )
    reaching_rate: float = quantity(
        0.03, "m/s^2", "speed controller, sliding mode: reaching rate", "E: form of H", 0.0, 10.0,
    )
    boundary_layer: float = quantity(
        0.15, "m/s", "speed controller, sliding mode: boundary layer", "E: form of H", 1e-3, 10.0,
    )
    maximum_rpm: float = quantity(
        1500.0, "rpm", "largest shaft speed command", "E: within reach of 24 V at rest", 10.0, 1e5,
    )
    proportional_gain: float = quantity(
        0.002, "V/rpm", "shaft speed controller: proportional gain", "E", 0.0, 10.0,
    )
    integral_gain: float = quantity(
        0.03, "V/(rpm s)", "shaft speed controller: integral gain", "E", 0.0, 100.0,
    )
    # fmt: on
    shafts: int = 2

    def __post_init__(self):
        if type(self.shafts) is not int or self.shafts not in (1, 2):
            raise refusal("shafts", self.shafts, "1 or 2", "count the shafts")
        for spec in fields(self):
            if spec.metadata:
                limits = spec.metadata["low"], spec.metadata["high"]
                finite_in_range(spec.name, getattr(self, spec.name), *limits)
        speed_per_rpm = (self.beta / -self.alpha) ** 0.5
        advance_ratio = 60.0 * speed_per_rpm / self.diameter * (1.0 - self.wake_fraction)
        if self.c2 and self.c2 * advance_ratio >= self.c1:
            largest = self.c1 / advance_ratio
            allowed = f"below {largest:.3g}, where the propeller would drive the motor"
            raise refusal("c2", self.c2, allowed, "lower c2 or raise c1")
        least_inertia = 1e-6 * self.torque_constant**2 / self.resistance
        if self.inertia * self.resistance < 1e-6 * self.torque_constant**2:
            allowed = f"from {least_inertia:.3g}, a motor time constant of 1 us"
            raise refusal("inertia", self.inertia, allowed, "raise it")

    @property
    def sides(self) -> tuple[str, ...]:
        """The sides that have a shaft."""
        return SIDES[: self.shafts]


def from_cruise(
    mass: float,
    drag: float,
    thrust: float,
    torque: float,
    rpm: float,
    diameter: float,
    wake_fraction: float,
    density: float,
    torque_fall: float,
) -> dict[str, float]:
    """Constants of a `Vehicle` with one propeller from published figures of its steady motion.

    Parameters
    ----------
    mass
        With the added mass [kg].
    drag
        Per squared surge speed [kg/m].
    thrust, torque
        Of the propeller [N], [N m] at this `rpm`, at the speed where thrust and drag balance.
    diameter, wake_fraction, density
        As in `Vehicle`.
    torque_fall
        c2 / c1.
    """
    speed = (thrust / drag) ** 0.5
    turns = rpm / 60.0
    advance_ratio = (1.0 - wake_fraction) * speed / (turns * diameter)
    torque_coefficient = torque / (density * diameter**5 * turns**2)
    c1 = torque_coefficient / (1.0 - torque_fall * advance_ratio)
    return {
        "alpha": -drag / mass,
        "beta": thrust / mass / rpm**2,
        "c1": c1,
        "c2": torque_fall * c1,
        "diameter": diameter,
        "wake_fraction": wake_fraction,
        "density": density,
    }


# REMUS 100: P, but for propeller diameter, wake, fall of the torque and largest rpm, F; motor E
_REMUS_MASS = 30.48 + 0.93  # kg
_REMUS = from_cruise(
    mass=_REMUS_MASS,
    drag=1.62,
    thrust=3.86,
    torque=0.543,
    rpm=1500.0,
    diameter=5.5 * INCH,
    wake_fraction=0.056,
    density=1030.0,
    torque_fall=(1.0 - 0.0312 / 0.0700) / 0.6632,
)
# Tethys: thrust by the coefficient of L, 0.004312 rho D^4 w^2; torque B; fall E, as T; motor E
_TETHYS_MASS = 147.8671 + 4.876161  # kg
_TETHYS_DENSITY = 1025.0  # kg/m^3
_TETHYS_DIAMETER = 0.2  # m
_TETHYS_CRUISE = 300.0  # rpm
_TETHYS = from_cruise(
    mass=_TETHYS_MASS,
    drag=6.2282,
    thrust=0.004312328
    * _TETHYS_DENSITY
    * _TETHYS_DIAMETER**4
    * (_TETHYS_CRUISE * math.pi / 30.0) ** 2,
    torque=0.23,
    rpm=_TETHYS_CRUISE,
    diameter=_TETHYS_DIAMETER,
    wake_fraction=0.1,
    density=_TETHYS_DENSITY,
    torque_fall=0.0285 / 0.0465,
)
PRESETS: dict[str, Vehicle] = {
    "thesis1992": Vehicle(),
    "npsnet1995": Vehicle(
        "npsnet1995", alpha=-0.0276 / FOOT, beta=2.252e-7 * FOOT, gamma=-0.0722 / FOOT
    ),
    "remus100": Vehicle(
        "remus100",
        **_REMUS,
        gamma=-4.1 / _REMUS_MASS,
        resistance=0.5,
        torque_constant=0.12,
        coulomb_friction=0.02,
        inertia=5e-5 + blade_pair_inertia(tip=2.75 * INCH),
        maximum_current=15.0,
        maximum_speed=1.5,
        maximum_rpm=1525.0,
        proportional_gain=0.004,
        integral_gain=0.06,
        shafts=1,
    ),
    "torpedo_1hz": Vehicle(
        "torpedo_1hz",
        **_TETHYS,
        gamma=-9.6 / _TETHYS_MASS,
        resistance=1.5,
        torque_constant=0.25,
        coulomb_friction=0.02,
        inertia=1.44e-4 + 3e-4,  # propeller L; armature and entrained water E
        maximum_voltage=14.4,
        maximum_current=5.0,
        maximum_speed=1.1,
        maximum_rpm=360.0,
        proportional_gain=0.008,
        integral_gain=0.12,
        shafts=1,
    ),
}


def full_scale_factors(vehicle: Vehicle) -> dict[str, float]:
    """Full scales of a vehicle relative to those of `thesis1992` in `CHANNELS`, by unit.

    They grow with its largest speed, shaft speed, voltage and current.
    """
    reference = PRESETS["thesis1992"]
    return {
        "m/s": vehicle.maximum_speed / reference.maximum_speed,
        "rpm": vehicle.maximum_rpm / reference.maximum_rpm,
        "V": vehicle.maximum_voltage / reference.maximum_voltage,
        "A": vehicle.maximum_current / reference.maximum_current,
        "m/s^2": 1.0,
        "rad": 1.0,
    }


def channels_of(vehicle: Vehicle) -> dict[str, Channel]:
    """The channels with the full scales of this vehicle, in the order of `CHANNELS`."""
    factors = full_scale_factors(vehicle)
    return {
        name: channel._replace(
            low=channel.low * factors[channel.unit], high=channel.high * factors[channel.unit]
        )
        for name, channel in CHANNELS.items()
    }


def vehicle_of(preset: str | Vehicle) -> Vehicle:
    """The vehicle of that preset, or the `Vehicle` itself; unknown names are refused."""
    return preset if isinstance(preset, Vehicle) else PRESETS[known_name("preset", preset, PRESETS)]


class Parameter(NamedTuple):
    """One parameter that varies from lane to lane and that a fault may change."""

    unit: str
    low: float
    high: float
    band: float
    about: str


HULL = ("alpha", "gamma")
SHAFT = (
    "beta",
    "c1",
    "c2",
    "resistance",
    "torque_constant",
    "coulomb_friction",
    "viscous_friction",
    "inertia",
)
SENSOR = ("bias", "gain", "noise", "stuck", "dropout")
# of a sensor too, after all others
SIGNAL = ("latency", "ripple")
LONGEST_LATENCY = 7  # samples
RIPPLE_FREQUENCY = 1.3  # Hz


def _plant_parameter(name: str) -> Parameter:
    spec = Vehicle.__dataclass_fields__[name].metadata
    return Parameter(*(spec[key] for key in ("unit", "low", "high", "band", "about")))


def _sensor_parameters(channel: str) -> dict[str, Parameter]:
    unit, low, high, *_ = CHANNELS[channel]
    span = high - low
    return {
        f"{channel}_bias": Parameter(unit, -span, span, 0.0, "added to the reading"),
        f"{channel}_gain": Parameter("1", 0.0, 10.0, 0.0, "multiplies the reading"),
        f"{channel}_noise": Parameter(unit, 0.0, span, 0.0, "standard deviation of the reading"),
        f"{channel}_stuck": Parameter("1", 0.0, 1.0, 0.0, "share of samples that repeat the last"),
        f"{channel}_dropout": Parameter("1", 0.0, 1.0, 0.0, "share of samples that read zero"),
    }


def _signal_parameters(channel: str) -> dict[str, Parameter]:
    unit, low, high, *_ = CHANNELS[channel]
    late = "samples by which the reading is late"
    sine = f"amplitude of a sine of {RIPPLE_FREQUENCY} Hz in the reading"
    return {
        f"{channel}_latency": Parameter("1", 0.0, LONGEST_LATENCY, 0.0, late),
        f"{channel}_ripple": Parameter(unit, 0.0, high - low, 0.0, sine),
    }


# The rows of `layout` follow this order.
PARAMETERS: dict[str, Parameter] = {
    **{name: _plant_parameter(name) for name in HULL},
    **{f"{side}_{name}": _plant_parameter(name) for side in SIDES for name in SHAFT},
    **{name: spec for channel in READINGS for name, spec in _sensor_parameters(channel).items()},
    **{name: spec for channel in READINGS for name, spec in _signal_parameters(channel).items()},
}


def is_of_missing_side(name: str, vehicle: Vehicle) -> bool:
    """Whether a reading or a parameter, by its name, belongs to a shaft that does not exist."""
    return any(name.startswith(f"{side}_") for side in SIDES if side not in vehicle.sides)


def nominal(vehicle: Vehicle, sensor_noise: float = 1.0) -> dict[str, float]:
    """Healthy value of every parameter, in that order; the shafts share ``beta`` evenly.

    A shaft that does not exist gives no thrust, and its readings are always zero.
    """
    shaft = {name: getattr(vehicle, name) for name in SHAFT}
    values = {name: getattr(vehicle, name) for name in HULL}
    for side in SIDES:
        beta = vehicle.beta / vehicle.shafts if side in vehicle.sides else 0.0
        values |= {f"{side}_{name}": value for name, value in (shaft | {"beta": beta}).items()}
    for channel in READINGS:
        dropout = 1.0 if is_of_missing_side(channel, vehicle) else 0.0
        healthy = (0.0, 1.0, sensor_noise * CHANNELS[channel].noise, 0.0, dropout)
        values |= {f"{channel}_{name}": value for name, value in zip(SENSOR, healthy, strict=True)}
    return values | {f"{channel}_{name}": 0.0 for channel in READINGS for name in SIGNAL}


def describe(vehicle: Vehicle) -> list[dict]:
    """One row per constant: name, value, unit, meaning, source."""
    keys = ("unit", "about", "source")
    return [
        {"name": spec.name, "value": getattr(vehicle, spec.name)}
        | {key: spec.metadata[key] for key in keys}
        for spec in fields(vehicle)
        if spec.metadata
    ]
