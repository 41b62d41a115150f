"""Units of logs: the factor from each to the unit of the channels, and their spellings."""

import math

from auv_fault_env.errors import known_name
from auv_fault_env.parameters import FOOT

GRAVITY = 9.80665  # m/s^2, standard
KNOT = 1852 / 3600  # m/s

# Factors to the unit of the channels, by that unit, which comes first.
UNITS: dict[str, dict[str, float]] = {
    "m/s": {
        "m/s": 1.0,
        "cm/s": 0.01,
        "mm/s": 1e-3,
        "km/h": 1 / 3.6,
        "kn": KNOT,
        "ft/s": FOOT,
    },
    "m/s^2": {
        "m/s^2": 1.0,
        "cm/s^2": 0.01,
        "ft/s^2": FOOT,
        "g": GRAVITY,
        "mg": 0.001 * GRAVITY,
    },
    "rad": {"rad": 1.0, "deg": math.pi / 180, "mrad": 0.001},
    "V": {"V": 1.0, "mV": 0.001},
    "A": {"A": 1.0, "mA": 0.001},
    "rpm": {"rpm": 1.0, "rev/s": 60.0, "rad/s": 30 / math.pi},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86_400.0},
}
SPELLINGS = {
    "cm/s": "cms cm/sec",
    "mm/s": "mms mm/sec",
    "m/s": "mps m/sec ms-1 meter/s metre/s meters/s metres/s meters/sec metres/sec meters/second "
    "metres/second",
    "kn": "kt kts knot knots knop knoten noeuds nœuds nudos nodi 节 ノット",
    "km/h": "kmh kph km/hr",
    "ft/s": "fps ft/sec",
    "m/s^2": "mps2 m/s/s ms-2 m/sec2",
    "ft/s^2": "fps2 ft/s/s",
    "rad": "radian radians",
    "deg": "° degs degree degrees grad grados graus gradi grader 度",
    "V": "volt volts 伏",
    "mV": "millivolt millivolts",
    "A": "amp amps ampere amperes 安",
    "mA": "milliamp milliamps milliampere",
    "rpm": "rev/min r/min 1/min u/min min-1 tr/min giri/min g/min omdr/min 转/分",
    "rev/s": "rps r/s rev/sec 1/s hz s-1",
    "rad/s": "rad/sec rads-1 rads",
    "s": "sec secs second seconds sekunden secondes segundos secondi sekunder 秒",
    "ms": "msec millis millisecond milliseconds",
    "us": "usec µs μs microsecond microseconds",  # micro sign; mu
    "ns": "nsec nanosecond nanoseconds",
    "min": "minute minutes",
    "h": "hr hrs hour hours",
    "d": "day days",
}
# units that no channel has
OTHER_UNITS = """
    m cm mm km ft feet foot nmi meter metre meters metres fathom
    °c c degc celsius °f f degf k kelvin pa hpa kpa mpa bar mbar dbar psi atm
    cv dv ca da w kw mw watt watts j kj wh kwh mwh ah mah amphour amphours n nm kg t lb
    kg/m^3 g/l mg/l ug/l µg/l mg/m^3 um µm μm nm nmol/l umol/l µmol/l mmol/l
    % pct percent permille ppm ppb psu ppt ntu fnu fau rfu
    deg/s °/s degs/s deg/sec dps mrad/s s/m ms/cm us/cm µs/cm db ohm ohms kohm
    khz mhz bit bits byte bytes ut µt nt gauss tesla lux lx l/min m^2 m^3 m^3/s cpm cps
""".split()
EXPONENTS = {"²": "2", "⁻¹": "-1", "⁻²": "-2"}


def _plain(text: str) -> str:
    """The text in small letters, without brackets, blanks and marks of powers and products.

    What a time is counted from does not belong to its unit.
    """
    text = text.strip(" \t[]()").lower().partition(" since ")[0]
    for exponent, digits in EXPONENTS.items():
        text = text.replace(exponent, digits)
    return "".join(text.translate(str.maketrans("", "", " ^*·_")).split())


_KNOWN = {kind: {_plain(unit): unit for unit in units} for kind, units in UNITS.items()}
_SPELT = {_plain(text): unit for unit, texts in SPELLINGS.items() for text in texts.split()}

_OTHER = {_plain(text) for text in OTHER_UNITS}


def spelt(text: str, kind: str) -> str | None:
    """The unit of a kind (a key of `UNITS`) that a text names; None if it names none.

    >>> spelt("[Knots]", "m/s"), spelt("m/s²", "m/s^2"), spelt("V", "m/s")
    ('kn', 'm/s^2', None)
    """
    plain = _plain(text)
    unit = _KNOWN[kind].get(plain) or _SPELT.get(plain)
    return unit if unit in UNITS[kind] else None


def other_unit(text: str) -> bool:
    """Whether the text names a unit that no channel has.

    >>> other_unit("degC"), other_unit("uM"), other_unit("m/s")
    (True, True, False)
    """
    return _plain(text) in _OTHER


def is_unit(text: str) -> bool:
    """Whether the text names a unit of any kind."""
    return any(spelt(text, kind) for kind in UNITS)


def factor(thing: str, unit: object, kind: str) -> float:
    """Factor from a unit to that of the channels; an unknown unit is an `InputError`.

    >>> factor("unit of speed", "knots", "m/s")
    0.5144444444444445
    """
    known_unit = spelt(unit, kind) if isinstance(unit, str) else None
    return UNITS[kind][known_unit or known_name(thing, unit, UNITS[kind])]
