import math

import pytest

from auv_fault_env import CHANNELS
from auv_fault_env.errors import InputError
from training.field.units import SPELLINGS, UNITS, factor, is_unit, spelt

# NIST SP 811, appendix B.8: knot, foot; standard gravity by the third CGPM; the rest by definition.
VALUES = [
    ("m/s", "kn", 1852 / 3600),
    ("m/s", "ft/s", 0.3048),
    ("m/s", "km/h", 1000 / 3600),
    ("m/s", "cm/s", 0.01),
    ("m/s^2", "g", 9.80665),
    ("m/s^2", "ft/s^2", 0.3048),
    ("rad", "deg", math.pi / 180),
    ("V", "mV", 1e-3),
    ("A", "mA", 1e-3),
    ("rpm", "rev/s", 60.0),
    ("rpm", "rad/s", 60 / (2 * math.pi)),
    ("s", "ns", 1e-9),
    ("s", "h", 3600.0),
    ("s", "d", 86_400.0),
]


@pytest.mark.parametrize(("kind", "unit", "value"), VALUES)
def test_factors(kind, unit, value):
    assert factor("unit", unit, kind) == pytest.approx(value, rel=1e-12)


def test_every_channel_has_units_and_its_own_is_first():
    for channel in CHANNELS.values():
        assert next(iter(UNITS[channel.unit].items())) == (channel.unit, 1.0)


@pytest.mark.parametrize("unit", SPELLINGS)
def test_every_spelling_is_of_one_kind_and_in_capitals_too(unit):
    for spelling in SPELLINGS[unit].split():
        kinds = [kind for kind in UNITS if spelt(spelling, kind)]
        assert len(kinds) == 1
        assert spelt(f"[{spelling.upper()}]", kinds[0]) == unit


@pytest.mark.parametrize("text", ["", "speed", "m", "%", "degC"])
def test_other_words_are_no_units(text):
    assert not is_unit(text)


def test_unknown_unit_is_refused_with_the_list():
    with pytest.raises(
        InputError, match=r"unit of speed: got 'knts'; allowed is one of m/s, .*did you mean 'kn'"
    ):
        factor("unit of speed", "knts", "m/s")
