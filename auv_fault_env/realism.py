"""How real sensors and surroundings differ from the ideal plant, as data with unit and source.

`realism` is a factor on these magnitudes; 0 is the ideal plant. Sources: [E] is an estimate of this
project from the data sheets of common parts of that kind; it stands for no particular part.
"""

from collections import namedtuple
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.parameters import LONGEST_LATENCY, PARAMETERS

# the effects by name, each of which can act alone
EFFECTS: dict[str, str] = {
    "resolution": "readings are multiples of the step of their converter",
    "offsets": "the zero of every healthy sensor is off, by a constant of its vehicle",
    "gains": "the gain of every healthy sensor is off, by a constant of its vehicle",
    "latency": "some readings are late, by a constant of their vehicle",
    "outliers": "single readings are far off",
    "counters": "counters of pulses read exactly 0 below their least speed",
    "clipping": "readings saturate at the range of their converter",
    "tilt": "the accelerometer feels gravity when the vehicle pitches and rolls",
    "coloured_noise": "the paddle wheel turns in the eddies of the hull",
    "water_current": "the water's current changes; only the speed through the water shows it",
    "battery": "the supply's voltage falls with its charge and with the currents",
    "heating": "the motors warm up: copper resists more, magnets weaken",
}


class Imperfections(NamedTuple):
    """What is imperfect in a healthy sensor besides its white noise, in the unit of its reading.

    Step and full scale of the converter are those of `thesis1992`.
    """

    step: float  # of its converter
    zero: float  # largest offset
    gain: float  # largest relative error of the gain
    latency: int  # largest, in samples
    least: float  # a counter reads exactly 0 below; 0 for what is no counter
    low: float  # range of the converter
    high: float


class Origin(NamedTuple):
    """Which effect a field of `Imperfections` belongs to, and where its values come from."""

    effect: str
    source: str


IMPERFECTIONS_ORIGIN: dict[str, Origin] = {
    "step": Origin("resolution", "E: 10-bit converters on 24 V and 25 A, as those of the noise"),
    "zero": Origin("offsets", "E: 0.2 mg; 1 mV behind shunt and divider; paddle wheel calibrated"),
    "gain": Origin("gains", "E: paddle wheel 2 %, resistors and accelerometer 0.5 %"),
    "latency": Origin("latency", "E: a paddle wheel is averaged over 0.2 s, a shaft over 0.1 s"),
    "least": Origin("counters", "E: bearing friction; 60 pulses a turn, none in a sample"),
    "low": Origin("clipping", "E: unipolar converters"),
    "high": Origin("clipping", "E: full scale of the converter"),
}

_VOLTAGE = Imperfections(24.0 / 1023, 0.020, 0.005, 0, 0.0, 0.0, 24.0)
_CURRENT = Imperfections(25.0 / 1023, 0.020, 0.005, 0, 0.0, 0.0, 25.0)
_RPM = Imperfections(1.0, 0.0, 0.0, 1, 10.0, 0.0, 6000.0)
IMPERFECTIONS: dict[str, Imperfections] = {
    "speed": Imperfections(0.005, 0.005, 0.02, 2, 0.03, 0.0, 5.0),
    "acceleration": Imperfections(0.001, 0.002, 0.005, 0, 0.0, -2.0, 2.0),
    "port_voltage": _VOLTAGE,
    "port_current": _CURRENT,
    "port_rpm": _RPM,
    "starboard_voltage": _VOLTAGE,
    "starboard_current": _CURRENT,
    "starboard_rpm": _RPM,
}


class Magnitude(NamedTuple):
    """A constant of the surroundings; `realism` multiplies it if it is the size of an effect."""

    value: float
    unit: str
    effect: str
    is_size: bool
    about: str
    source: str


# fmt: off
SURROUNDINGS: dict[str, Magnitude] = {
    "outlier_probability": Magnitude(
        0.003, "1", "outliers", True, "of an outlier, by sample and channel", "E"),
    "outlier_size": Magnitude(
        8.0, "1", "outliers", False, "outlier by default noise (1 sigma) of the channel", "E"),
    "pitch": Magnitude(0.1, "deg", "tilt", True, "standard deviation of the pitch", "E: trimmed"),
    "pitch_time": Magnitude(3.0, "s", "tilt", False, "correlation time of the pitch", "E"),
    "roll": Magnitude(1.0, "deg", "tilt", True, "standard deviation of the roll", "E"),
    "roll_time": Magnitude(2.0, "s", "tilt", False, "correlation time of the roll", "E"),
    "cross_axis": Magnitude(
        0.01, "1", "tilt", False, "share of sideward gravity that the accelerometer feels",
        "E: cross-axis sensitivity of common parts"),
    "wheel_noise": Magnitude(
        0.005, "m/s", "coloured_noise", True, "standard deviation at the paddle wheel", "E"),
    "wheel_noise_time": Magnitude(1.0, "s", "coloured_noise", False, "its correlation time", "E"),
    "current_range": Magnitude(
        0.1, "m/s", "water_current", True, "largest current of the water, either way", "E"),
    "current_rate": Magnitude(
        1.0 / 600.0, "1/s", "water_current", False, "rate at which the vehicle enters other water",
        "E: once in ten minutes"),
    "current_time": Magnitude(
        2.0, "s", "water_current", False, "time constant of the change: a layer's edge", "E"),
    "supply_fade": Magnitude(
        0.025, "1/h", "battery", True, "share of the voltage lost as the charge falls",
        "E: lead-acid, a tenth in four hours"),
    "supply_droop": Magnitude(
        0.002, "1/A", "battery", True, "share of the voltage lost at the current of both motors",
        "E: 0.05 ohm at 24 V"),
    "thermal_resistance": Magnitude(
        3.0, "K/W", "heating", True, "from the winding to the water", "E: small motor in water"),
    "thermal_time": Magnitude(600.0, "s", "heating", False, "time constant of the winding", "E"),
    "hottest": Magnitude(
        130.0, "K", "heating", False, "above the water, at most: its insulation's limit",
        "E: class F, 155 C"),
    "copper": Magnitude(0.0039, "1/K", "heating", False, "resistance by temperature", "copper"),
    "magnets": Magnitude(-0.002, "1/K", "heating", False, "K_T by temperature", "ferrite magnets"),
}
# fmt: on

# the values that enter the kernel
Surroundings = namedtuple("Surroundings", list(SURROUNDINGS))
N_SURROUNDINGS = len(SURROUNDINGS)


class Conversion(NamedTuple):
    """How a kernel turns the signal of a sensor into its reading, in the reading's unit."""

    step: float  # 0 for none
    least: float
    low: float
    high: float
    outlier: float


N_CONVERSION = len(Conversion._fields)


def known_effects(names: Sequence[str] | None) -> tuple[str, ...]:
    """The names of the effects that act, None for all; unknown names are refused."""
    if names is None:
        return tuple(EFFECTS)
    if isinstance(names, str) or not isinstance(names, Sequence):
        remedy = "put the names into a list"
        raise refusal("imperfections", names, "None or a list of names", remedy)
    return tuple(known_name("imperfection", name, EFFECTS) for name in names)


def surroundings(realism: float, effects: Sequence[str]) -> Surroundings:
    """The constants of the surroundings when these effects act."""
    factors = {name: realism if name in effects else 0.0 for name in EFFECTS}
    values = []
    for magnitude in SURROUNDINGS.values():
        factor = factors[magnitude.effect] if magnitude.is_size else 1.0
        values.append(factor * magnitude.value)
    return Surroundings(*values)


def conversion(
    channel: str, realism: float, effects: Sequence[str], factor: float = 1.0
) -> Conversion:
    """How the signal of this channel's sensor becomes its reading when these effects act.

    factor: full scale of the vehicle's channel relative to that of `thesis1992`.
    """
    datum = IMPERFECTIONS[channel]
    clips = realism > 0.0 and "clipping" in effects
    return Conversion(
        step=realism * datum.step * factor if "resolution" in effects else 0.0,
        least=realism * datum.least if "counters" in effects else 0.0,
        low=datum.low * factor if clips else -np.inf,
        high=datum.high * factor if clips else np.inf,
        outlier=SURROUNDINGS["outlier_size"].value * CHANNELS[channel].noise,
    )


def kernel_values(
    realism: float, effects: Sequence[str], factors: Mapping[str, float]
) -> np.ndarray:
    """`Surroundings` and the `Conversion` of every reading as one array, for the kernels.

    factors: `parameters.full_scale_factors` of the vehicle.
    """
    conversions = [
        conversion(channel, realism, effects, factors[CHANNELS[channel].unit])
        for channel in READINGS
    ]
    return np.concatenate([surroundings(realism, effects), *conversions])


def healthy_spread(realism: float, effects: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Largest shift and largest latency of each of `PARAMETERS`, both (n_parameters,).

    A healthy vehicle is drawn within plus and minus the shift, and from 0 to the latency, a whole
    number.
    """
    names = list(PARAMETERS)
    shift = np.zeros(len(names))
    latency = np.zeros(len(names))
    for channel, datum in IMPERFECTIONS.items():
        if "offsets" in effects:
            shift[names.index(f"{channel}_bias")] = realism * datum.zero
        if "gains" in effects:
            shift[names.index(f"{channel}_gain")] = realism * datum.gain
        if "latency" in effects:
            largest = min(round(realism * datum.latency), LONGEST_LATENCY)
            latency[names.index(f"{channel}_latency")] = largest
    return shift, latency
