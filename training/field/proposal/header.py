"""The meaning of a column's name: quantity, side and unit."""

import re
from typing import NamedTuple

from training.field.units import is_unit, spelt

# By quantity: the kind of its unit (the unit of the channel), and words that name it.
QUANTITIES = {
    "time": (
        "s",
        "time t timestamp stamp datetime date clock epoch utc sec secs seconds",
    ),
    "speed": ("m/s", "speed velocity velo vel u surge spd stw"),
    "acceleration": ("m/s^2", "acceleration accel acc ax udot"),
    "voltage": ("V", "voltage volt volts v"),
    "current": ("A", "current curr amp amps ampere i"),
    "rpm": ("rpm", "rpm rps n rev revs revolutions"),
    "rudder": ("rad", "rudder rud"),
    "stern_plane": ("rad", "stern plane planes sternplane elevator"),
    "motor_command": ("", "pwm throttle duty"),
}
COMMANDED = frozenset(
    "cmd command commanded setpoint set sp desired des ref reference demand target goal".split()
)
COMMANDS = {
    "speed": "speed_command",
    "rpm": "motor_command",
    "voltage": "motor_command",
}
SHAFT = frozenset("motor shaft prop propeller thruster engine screw".split())
SIDED = ("voltage", "current", "rpm", "motor_command")
SIDES = {
    "port": frozenset("port p ps left l bb 1".split()),
    "starboard": frozenset("starboard stbd stb sb right r 2".split()),
}
# a column with one of these words is none of the vehicle's channels
FOREIGN = frozenset(
    "battery bat batt bus supply hotel wind sway heave yaw pitch roll heading psi depth "
    "temperature temp position pos lat lon error err std var variance flag mode id count y z "
    "angvelo truth seed vehicle".split()
)


class Meaning(NamedTuple):
    """A possible meaning of a column."""

    quantity: str  # one of `QUANTITIES`, or a command
    side: str  # port if the name has none
    unit: str | None  # None if the name has none
    score: int  # the higher, the more certain


def meaning(name: str, unit: str = "") -> Meaning | None:
    """The most certain meaning of a column with this name and unit; None if it is no channel.

    >>> meaning("thruster2_current_A")
    Meaning(quantity='current', side='starboard', unit='A', score=2)
    >>> meaning("Speed [kn]").unit, meaning("V_bat"), meaning("v [m/s]")
    ('kn', None, None)
    """
    label = re.search(r"[\[(]([^\])]*)[\])]", name)
    if label and is_unit(label[1]):
        name = name.replace(label[0], " ")
        unit = label[1]
    words = _words(name)
    if FOREIGN & set(words):
        return None
    meanings = [_meaning_as(quantity, words, unit) for quantity in QUANTITIES]
    return max(filter(None, meanings), key=lambda candidate: candidate.score, default=None)


def _words(name: str) -> list[str]:
    """The words of a name in small letters, cut at marks, digits and capitals; units stay whole."""
    words = []
    for part in re.findall(r"[A-Za-z]+|\d+", name):
        if is_unit(part):
            words.append(part)
        else:
            words += re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", part)
    return [word.lower() for word in words]


def _meaning_as(quantity: str, words: list[str], unit: str) -> Meaning | None:
    """The column as this quantity, if a word names it and a separate unit is of its kind."""
    kind, quantity_names = QUANTITIES[quantity]
    names = set(quantity_names.split())
    names_shaft = bool(SHAFT.intersection(words))
    if quantity == "rpm" and names_shaft:
        names |= {"speed", "velocity"}
    if quantity in ("speed", "voltage") and COMMANDED.intersection(words):
        names ^= {"v"}  # v_set is a speed, while v_port is a voltage
    score = len(names.intersection(words))
    score += "".join(words) in names and len(words) > 1
    known_unit = spelt(unit, kind) if unit and kind else _unit_in_name(words, kind)
    numbers = [word for word in words if word.isdigit()]
    is_further_shaft = quantity in SIDED and not set(numbers) <= {"1", "2"}
    is_other_unit = bool(unit and kind) and not known_unit
    is_shaft_speed = quantity == "speed" and names_shaft and not known_unit
    if not score or is_further_shaft or is_other_unit or is_shaft_speed:
        return None
    side = next((side for side, marks in SIDES.items() if marks.intersection(words)), "port")
    score += known_unit is not None
    return Meaning(_commanded(quantity, words), side, known_unit, score)


def _commanded(quantity: str, words: list[str]) -> str:
    """The quantity, or its command if a word says so."""
    if quantity == "speed" and "mission" in words:
        return "mission_speed"
    return COMMANDS.get(quantity, quantity) if COMMANDED.intersection(words) else quantity


def _unit_in_name(words: list[str], kind: str) -> str | None:
    """A unit among the words, as in ``u_mps``, ``speed_m_s`` and ``port_rpm``."""
    if not kind:
        return None
    long_words = [word for word in words if len(word) > 2]
    candidates = ["/".join(words[-2:]), *words[-1:], *long_words]
    units = (spelt(candidate, kind) for candidate in candidates)
    return next(filter(None, units), None)
