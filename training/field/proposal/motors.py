"""The channels of the motors: measured, by command and supply, or as drawn from the battery."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SIDES, Vehicle
from training.field.proposal.columns import Found
from training.field.proposal.duty import Levels, levels_of
from training.field.proposal.evidence import KINDS, Match, are_pulses, unit_by_size
from training.field.proposal.guess import Guess, guess_of
from training.field.units import UNITS
from training.field.vehicle_file import Column

STANDING = 0.1  # of the largest speed or shaft speed, below which vehicle or shaft stands
FEWEST_ROWS = 5  # at which the vehicle stands
STAYS = 0.5  # of its median while driven: a voltage that stays above it while the shaft stands
STEADY = 0.15  # relative spread of a supply's voltage, at most
DRIVEN = 0.5  # relative spread of the shaft speed, at least, by which a supply's voltage is known
PHRASES = {"voltage": "the supply's voltage", "current": "the supply's current"}


class Motors(NamedTuple):
    """What the channels of the motors are guessed from; guesses are added to."""

    found: Found
    columns: Mapping[str, np.ndarray]
    guesses: dict[str, Guess]
    vehicle: Vehicle

    def match(self, channel: str) -> Match | None:
        """The column of a channel, of `Found.best`."""
        return self.found.best.get(channel)

    def values(self, match: Match) -> np.ndarray:
        """Its values (n_rows,) in the unit of the channel, or as they are for a duty."""
        values = self.columns[match.label]
        return values * _factor(match, values)


def _factor(match: Match, values: np.ndarray) -> float:
    kind = KINDS[match.quantity]
    return UNITS[kind][unit_by_size(kind, match.unit, values) or kind] if kind else 1.0


def guesses_of_motors(motors: Motors) -> None:
    """Add the channels of both shafts to the guesses, and the reasons of what is left out."""
    sides = [side for side in SIDES if any(one.startswith(side) for one in motors.found.best)]
    supplies = {side: _supply(motors, side) for side in sides}
    for side in sides:
        for quantity in ("voltage", "current", "rpm"):
            match = motors.match(f"{side}_{quantity}")
            if match and match is not supplies[side]:
                motors.guesses[f"{side}_{quantity}"] = guess_of(match, motors.columns)
    _add_supply_current(motors, sides)
    for side in sides:
        _add_shaft_command(motors, side)
        _add_duty(motors, side, supplies[side])
    _leave_out_supply(motors)


def _standing(motors: Motors, side: str) -> np.ndarray:
    """Whether the vehicle stands with this motor off, by all that shows it; (n_rows,)."""
    n_rows = len(next(iter(motors.columns.values())))
    is_standing = np.ones(n_rows, bool)
    shown_by = [motors.match(one) for one in (f"{side}_rpm", "speed", "speed_command")]
    known = [motors.values(match) for match in shown_by if match]
    for values in known:
        size = abs(values)
        largest = np.nanmax(size, initial=0.0, where=np.isfinite(size))
        is_standing &= size < STANDING * largest
    return is_standing if known else np.zeros(n_rows, bool)


def _supply(motors: Motors, side: str) -> Match | None:
    """The supply's voltage for this side: that of the battery, or one that stays at standstill."""
    own = motors.match(f"{side}_voltage")
    if own and _stays(motors, side, own):
        return own
    of_side = (
        match
        for match in motors.found.matches.values()
        if match.quantity == "supply_voltage" and match.mark == side
    )
    return next(of_side, motors.match("supply_voltage"))


def _stays(motors: Motors, side: str, match: Match) -> bool:
    """Whether a voltage stays while the motor stands, or while its drive changes."""
    values = abs(motors.values(match))
    is_read = np.isfinite(values)
    is_standing = _standing(motors, side)
    at_rest = values[is_standing & is_read]
    driven = values[~is_standing & is_read]
    if at_rest.size >= FEWEST_ROWS and driven.size:
        return float(np.median(at_rest)) > STAYS * float(np.median(driven))
    rpm = motors.match(f"{side}_rpm")
    is_driven = rpm is not None and _spread(motors.values(rpm)) > DRIVEN
    return is_driven and _spread(values) < STEADY


def _spread(values: np.ndarray) -> float:
    low, middle, high = np.nanpercentile(abs(values), (5, 50, 95))
    return float((high - low) / middle) if middle else np.inf


def _add_supply_current(motors: Motors, sides: list[str]) -> None:
    """The supply's current for that of the only motor, less what is drawn at standstill."""
    match = motors.match("supply_current")
    is_measured = any(f"{side}_current" in motors.guesses for side in SIDES)
    is_only = len(sides) == 1 and not motors.found.has_further_thrusters
    if not match or is_measured or not is_only:
        return
    column = guess_of(match, motors.columns).column
    values = column.scale * motors.columns[match.label]
    reversed_sign = np.nansum(np.sign(values)) < 0
    values = -values if reversed_sign else values
    at_rest = values[_standing(motors, SIDES[0]) & np.isfinite(values)]
    drawn = float(np.mean(at_rest)) if at_rest.size >= FEWEST_ROWS else 0.0
    drawn = float(f"{drawn:.3g}")
    why = "the supply's, for that of the motor is not logged"
    why += "; negative when it is drawn: sign reversed" if reversed_sign else ""
    why += f"; without the {drawn:g} A at standstill" if drawn else "; others may draw from it too"
    scale = -column.scale if reversed_sign else column.scale
    motors.guesses["port_current"] = Guess(column._replace(scale=scale, offset=-drawn), why)


def _add_shaft_command(motors: Motors, side: str) -> None:
    """A commanded shaft speed for a shaft speed that is not measured."""
    match = motors.match(f"{side}_rpm_command")
    if not match:
        return
    rpm = motors.guesses.get(f"{side}_rpm")
    if rpm:
        motors.found.left_out[match.label] = f"a command; {side} rpm is {rpm.column.name!r}"
    elif _is_duty(match, motors.columns[match.label]):
        motors.found.best.setdefault(f"{side}_duty", match._replace(quantity="duty"))
    else:
        guess = guess_of(match, motors.columns)
        why = f"{guess.why}; the command replaces the shaft speed, which is not logged"
        motors.guesses[f"{side}_rpm"] = guess._replace(why=why)


def _is_duty(match: Match, values: np.ndarray) -> bool:
    """Whether the command of a shaft speed has no unit and the size of a duty."""
    known = values[np.isfinite(values)]
    return match.unit is None and (float(abs(known).max()) <= 255 or are_pulses(known))


def _add_duty(motors: Motors, side: str, supply: Match | None) -> None:
    """The voltage at the motor from duty and supply; without a current the shaft speed."""
    match = motors.match(f"{side}_duty")
    if not match:
        return
    if f"{side}_voltage" in motors.guesses:
        motors.found.left_out[match.label] = f"a command; the {side} voltage is measured"
        return
    levels = _levels(motors, side, match)
    if levels is None:
        why = "its value at rest is not in the log: 0, 127 and 128 are usual"
        motors.found.left_out[match.label] = why
        return
    scale = 1.0 / levels.span
    offset = -levels.rest * scale
    about = f"the motor command: {levels.why}"
    if supply:
        factor = _factor(supply, motors.columns[supply.label])
        column = Column(match.label, scale * factor, offset * factor, supply.label)
        why = f"{about}; times the supply's voltage"
        motors.guesses[f"{side}_voltage"] = Guess(column, why)
        return
    if any(f"{side}_{name}" in motors.guesses for name in ("current", "rpm")):
        channel = f"{side}_voltage"
        full = motors.vehicle.maximum_voltage
        unit = "V, a guess: write the supply's voltage"
    else:
        channel = f"{side}_rpm"
        full = motors.vehicle.maximum_rpm
        unit = "rpm, a guess: it replaces the shaft speed"
    column = Column(match.label, scale * full, offset * full)
    motors.guesses[channel] = Guess(column, f"{about}; full is {full:g} {unit}")


def _levels(motors: Motors, side: str, match: Match) -> Levels | None:
    speed = motors.match("speed")
    goes_ahead = True
    if speed:
        values = motors.values(speed)
        values = values * (np.sign(np.nansum(values)) or 1.0)
        goes_ahead = float(np.mean(values < -STANDING * np.nanmax(abs(values)))) < 0.01
    command = motors.columns[match.label]
    return levels_of(command, match.unit, _standing(motors, side), goes_ahead)


def _leave_out_supply(motors: Motors) -> None:
    """The reason why a column of the supply is not used, or a voltage that is the supply's."""
    used = {name for guess in motors.guesses.values() for name in guess.column.names}
    for label, match in motors.found.matches.items():
        if label in used or not match.quantity.endswith(("voltage", "current")):
            continue
        if match.quantity.startswith("supply"):
            about = PHRASES[match.quantity.removeprefix("supply_")]
            motors.found.left_out[label] = f"{about}, not that of a motor"
        elif match in motors.found.best.values():
            motors.found.left_out[label] = "it stays while the motor stands: the supply's voltage"
