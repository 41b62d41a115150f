"""What the name of a column says: the quantity, the side, the unit."""

import re
from typing import NamedTuple

from training.field.units import is_unit, spelt

# By quantity: the kind of its unit (the unit of the channel), and words that name it.
QUANTITIES: dict[str, tuple[str, frozenset[str]]] = {
    "time": (
        "s",
        frozenset("time t timestamp stamp datetime date clock epoch utc sec secs seconds".split()),
    ),
    "speed": ("m/s", frozenset("speed velocity velo vel u surge spd stw".split())),
    "acceleration": ("m/s^2", frozenset("acceleration accel acc ax udot".split())),
    "voltage": ("V", frozenset("voltage volt volts v".split())),
    "current": ("A", frozenset("current curr amp amps ampere i".split())),
    "rpm": ("rpm", frozenset("rpm rps n rev revs revolutions".split())),
    "rudder": ("rad", frozenset("rudder rud".split())),
    "stern_plane": ("rad", frozenset("stern plane planes sternplane elevator".split())),
    "motor_command": ("", frozenset("pwm throttle duty".split())),
}
COMMANDED = frozenset(
    "cmd command commanded setpoint set sp desired des ref reference demand target goal".split()
)
SHAFT = frozenset("motor shaft prop propeller thruster engine screw".split())
SIDED = ("voltage", "current", "rpm", "motor_command")
SIDES = {
    "port": frozenset("port p ps left l bb 1".split()),
    "starboard": frozenset("starboard stbd stb sb right r 2".split()),
}
FOREIGN = frozenset(
    "battery bat batt bus supply hotel wind sway heave yaw pitch roll heading psi depth temperature temp position pos "
    "lat lon error err std var variance flag mode id count y z angvelo truth seed vehicle".split()
)  # a column with one of these words is none of the vehicle's channels


class Meaning(NamedTuple):
    """What a column may be: quantity, side (port if none is named), unit if it is named, and how sure that is."""

    quantity: str
    side: str
    unit: str | None
    score: int


def meaning(name: str, unit: str = "") -> Meaning | None:
    """What a column of this name may be, with the unit that stands under it; None if it is no channel.

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
    found = (
        [_as(quantity, words, unit) for quantity in QUANTITIES] if not FOREIGN & set(words) else []
    )
    return max(filter(None, found), key=lambda one: one.score, default=None)


def _words(name: str) -> list[str]:
    """The words of a name in small letters, cut at marks, digits and capitals, but a unit whole."""
    parts = re.findall(r"[A-Za-z]+|\d+", name)
    cut = (
        re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", part) if not is_unit(part) else [part]
        for part in parts
    )
    return [word.lower() for words in cut for word in words]


def _as(quantity: str, words: list[str], unit: str) -> Meaning | None:
    """The column as this quantity, if a word of it is there and the unit, if one stands apart, is of its kind."""
    kind, names = QUANTITIES[quantity]
    of_shaft = bool(SHAFT.intersection(words))
    if quantity == "rpm" and of_shaft:
        names = names | {"speed", "velocity"}
    if quantity in ("speed", "voltage") and COMMANDED.intersection(words):
        names = names ^ {"v"}  # v_set is a speed, while v_port is a voltage
    score = len(names.intersection(words)) + ("".join(words) in names and len(words) > 1)
    found = spelt(unit, kind) if unit and kind else _suffix(words, kind)
    third = quantity in SIDED and any(word.isdigit() and word not in ("1", "2") for word in words)
    misfit = (unit and kind and not found) or (quantity == "speed" and of_shaft and not found)
    if not score or third or misfit:
        return None
    side = next((side for side, marks in SIDES.items() if marks.intersection(words)), "port")
    return Meaning(_commanded(quantity, words), side, found, score + (found is not None))


def _commanded(quantity: str, words: list[str]) -> str:
    if quantity == "speed" and "mission" in words:
        return "mission_speed"
    commands = {"speed": "speed_command", "rpm": "motor_command", "voltage": "motor_command"}
    return commands.get(quantity, quantity) if COMMANDED.intersection(words) else quantity


def _suffix(words: list[str], kind: str) -> str | None:
    """A unit among the last words, as in ``u_mps``, ``speed_m_s`` and ``port_rpm``."""
    ends = ("/".join(words[-2:]), *words[-1:], *(word for word in words if len(word) > 2))
    return next((unit for end in ends if kind and (unit := spelt(end, kind))), None)
