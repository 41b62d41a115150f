"""What a symbol such as u, v or I is, by its unit, its side and the other columns of the log."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from training.field.proposal.header import Name, without_accents
from training.field.proposal.sides import Mark
from training.field.proposal.words import SYMBOLS
from training.field.units import spelt

U_OR_V = re.compile(r"(?<![^\W\d_])[uUvV](?![^\W\d_])|[uUvV]")
MEASURED_SPEED = frozenset({"water", "ground", "surge"})
SPEED_ROLES = MEASURED_SPEED | {"command", "mission"}
SEA = "the sea's current"  # of `words.OTHERS`
DIRECTION = frozenset("direction richtung direccion direzione direcao retning".split())
TURNS = frozenset("rwpq")  # letters of sway, heave and turning beside u and v


class Context(NamedTuple):
    """What the names of a whole log say about a name that could be several things."""

    letters: frozenset[str]  # names of one letter
    quantities: frozenset[str]  # that words or other symbols name
    others: frozenset[str]  # what other words name, of `words.OTHERS`
    stems: frozenset[tuple[str, ...]]


def context_of(names: Mapping[str, Name]) -> Context:
    """The context of a log's names."""
    quantities: set[str] = set()
    for name in names.values():
        if not name.others and not name.roles & {"supply", "command", "mission"}:
            is_shaft = "motor" in name.roles and name.quantities == {"speed"}
            quantities |= {"rpm"} if is_shaft else name.quantities
        if name.symbol in ("u", "v") and name.roles & MEASURED_SPEED:
            quantities.add("speed")
        elif name.symbol in ("u", "v") and _is_of_motor(name):
            quantities.add("voltage")
        if name.symbol == "i":
            quantities.add("current")
    letters = frozenset(label.strip() for label in names if len(label.strip()) == 1)
    others = {other for name in names.values() for other in name.others.values()}
    if any(map(_is_of_sea, names.values())):
        others.add(SEA)
    stems = frozenset(name.stem for name in names.values())
    return Context(letters, frozenset(quantities), frozenset(others), stems)


def _is_of_sea(name: Name) -> bool:
    """Whether the name is that of a current's direction or speed, in any language."""
    has_direction = not DIRECTION.isdisjoint(name.stem)
    return "current" in name.quantities and (has_direction or "speed" in name.quantities)


def _is_of_motor(name: Name) -> bool:
    is_numbered = any(word.isdigit() for word in name.stem)
    return is_numbered or bool(name.roles & {"motor", "port", "starboard"})


def quantity_of_symbol(label: str, name: Name, mark: Mark, context: Context) -> tuple[str, str]:
    """The quantity of a symbol, and why there is none."""
    alone, of_part = SYMBOLS[name.symbol]
    is_part = mark is not None or bool(name.roles & {"motor", "supply"})
    if name.symbol in ("u", "v"):
        return _of_u_or_v(label, name, mark, is_part, context)
    if label.strip() == "A":
        return "", "it could be a current in A or an acceleration"
    if name.symbol == "vx" and _is_in_fixed_frame(name.stem, context.stems):
        return "", "beside x and y, or u and v, it is along a fixed axis, not along the vehicle"
    return (of_part if is_part else alone) or "", ""


def _is_in_fixed_frame(stem: tuple[str, ...], stems: frozenset[tuple[str, ...]]) -> bool:
    """Whether the log has the place beside vx, or the velocity along the vehicle besides."""
    group = stem[: stem.index("vx")]
    has_place = {(*group, "x"), (*group, "y")} <= stems
    has_body = {(*group, "u"), (*group, "v")} <= stems
    return has_place or has_body


def _of_u_or_v(
    label: str, name: Name, mark: Mark, is_part: bool, context: Context
) -> tuple[str, str]:
    """u and v are a speed or a voltage: by unit, side and the other columns."""
    letter = U_OR_V.search(without_accents(label))[0]
    is_number_alone = isinstance(mark, int) and not name.roles & {"motor", "supply"}
    is_electric = letter.isupper() or "current" in context.quantities
    is_ambiguous = is_number_alone and not is_electric
    if spelt(name.unit, "V") or (is_part and not is_ambiguous):
        return "voltage", ""
    if is_part:
        return "", f"{letter!r} with a number could be a voltage, a speed or a command"
    if name.roles & SPEED_ROLES:
        return "speed", ""
    if spelt(name.unit, "m/s") and letter != "v":
        return "speed", ""
    if letter == "v" and "u" in context.letters and context.letters & TURNS:
        return "", "beside u and the turn rates it is sway"
    decide = {"u": _small_u, "v": _small_v, "U": _capital_u, "V": _capital_v}[letter]
    quantity = decide(context.letters, context.quantities)
    if letter == "v" and name.unit:
        is_only = "u" not in context.letters and "speed" not in context.quantities
        quantity = "speed" if is_only else ""
    return quantity, "" if quantity else f"{letter!r} could be a speed, sway or a voltage"


def _small_u(letters: frozenset[str], named: frozenset[str]) -> str:
    if "speed" in named:
        return "voltage" if "i" in letters and "voltage" not in named else "speed"
    return "" if letters >= {"v", "i"} and not letters & TURNS else "speed"


def _small_v(letters: frozenset[str], named: frozenset[str]) -> str:
    if "u" in letters:
        return ""
    if "U" in letters or "voltage" in named:
        return "" if "speed" in named else "speed"
    is_electric = "current" in named if "speed" in named else "i" in letters
    return "voltage" if is_electric else ""


def _capital_u(letters: frozenset[str], named: frozenset[str]) -> str:
    has_voltage = "V" in letters or "voltage" in named
    if letters >= {"u", "v"}:
        return ""  # the whole speed of u, v and w, or a voltage
    if letters & {"u", "v"} or "speed" in named:
        return "" if has_voltage else "voltage"
    if has_voltage:
        return "speed"
    return "voltage" if "current" in named else ""


def _capital_v(letters: frozenset[str], named: frozenset[str]) -> str:
    if "u" in letters or "speed" in named:
        return "voltage"
    return "voltage" if "current" in named and "voltage" not in named else ""
