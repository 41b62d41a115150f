"""Whether readings can be the vehicle's: infinite, impossible, missing, constant, wrong unit."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, READINGS
from auv_fault_env.errors import refusal
from auv_fault_env.parameters import SIDES, Vehicle, channels_of
from auv_fault_env.physics import RPM
from training.field.units import GRAVITY, UNITS
from training.field.vehicle_file import VehicleFile, unit_of

IMPOSSIBLE = 2.0  # times the largest value that sensor or vehicle can reach
# share of impossible values from which the unit is wrong
WRONG_UNIT = 0.05
LEAST_SHARE = 0.02  # of the largest magnitude, below which a typical reading is in another unit
TURNING = 0.1  # of the largest shaft speed, above which a shaft turns


class Disagreement(NamedTuple):
    """Factors between two readings."""

    least: float  # from which one may be in another unit
    explained: float  # up to which a unit explains them


OF_PRESET = Disagreement(3.0, 2.0)
# a metre per second is 1.9 knots; twice the drag, or one lost propeller of two, is a factor of 1.4;
# where the only propeller is lost, the remark is a false one
OF_CALIBRATED = Disagreement(1.6, 1.2)
SURELY = 1.08  # of the speed; knots for km/h would be 1.85, feet per second 1.1 times as much
PARTS = 4  # of a log, which have to agree on a unit
AGREES = (("", ""),)  # in place of a channel and unit


def largest_magnitudes(vehicle: Vehicle) -> dict[str, float]:
    """The largest magnitude [unit of the channel] by channel: full scale, or the vehicle's reach.

    Rough on purpose: shaft speed without load, current at stall, speed without slip, gravity on a
    tilted accelerometer, any deflection of a fin.
    """
    reach = _reach(vehicle)
    scaled = channels_of(vehicle)
    return {
        name: max(
            -channel.low, channel.high, -scaled[name].low, scaled[name].high, reach[channel.unit]
        )
        for name, channel in CHANNELS.items()
    }


def _reach(vehicle: Vehicle) -> dict[str, float]:
    """The largest magnitude that the vehicle can reach, by the unit of the channel."""
    rpm = vehicle.maximum_voltage / vehicle.torque_constant * RPM
    return {
        "m/s": rpm * _speed_per_rpm(vehicle),
        "m/s^2": GRAVITY,
        "rad": math.pi / 2,
        "rpm": rpm,
        "V": vehicle.maximum_voltage,
        "A": vehicle.maximum_voltage / vehicle.resistance,
    }


def _speed_per_rpm(vehicle: Vehicle) -> float:
    """Steady surge speed per shaft speed [m/s per rpm], both shafts alike."""
    return math.sqrt(vehicle.beta / -vehicle.alpha)


def plausible_values(
    values: Mapping[str, np.ndarray], vehicle: VehicleFile, remarks: list[str]
) -> dict[str, np.ndarray]:
    """The values by channel (n_rows,), NaN for values that no sensor can have reported.

    `InputError` if a channel is in another unit than the file says, or if no reading is left.
    """
    limits = largest_magnitudes(vehicle.vehicle)
    values = {
        channel: _possible_values(channel, column, limits[channel], vehicle, remarks)
        for channel, column in values.items()
    }
    readings = [channel for channel in READINGS if channel in values]
    for channel in readings:
        _remark_missing_or_constant(channel, values[channel], remarks)
    if not any(np.isfinite(values[channel]).any() for channel in readings):
        allowed = "at least one number in a column of a reading"
        raise refusal("log", "no reading", allowed, "check its columns")
    _remark_disagreement(values, vehicle, remarks)
    _remark_turned_sign(values, remarks)
    return values


def _possible_values(
    channel: str, column: np.ndarray, limit: float, vehicle: VehicleFile, remarks: list[str]
) -> np.ndarray:
    unit = CHANNELS[channel].unit
    size = abs(column)
    is_infinite = np.isinf(column)
    is_impossible = (size > IMPOSSIBLE * limit) & ~is_infinite
    is_beyond = (size > limit) & ~is_impossible & ~is_infinite
    if is_infinite.any():
        remarks.append(f"{channel}: infinite values taken as missing ({is_infinite.sum()})")
    if is_beyond.any():
        span = f"values beyond {limit:.3g} {unit}, up to {size[is_beyond].max():.3g}"
        remarks.append(f"{channel}: {span}, kept ({is_beyond.sum()})")
    if is_impossible.any():
        now = unit_of(vehicle.columns[channel], unit)
        _check_unit(channel, column, is_impossible, limit, now)
        example = f"such as {column[is_impossible][0]:.6g} {unit}"
        count = is_impossible.sum()
        remarks.append(f"{channel}: impossible values, {example}, taken as missing ({count})")
    return np.where(is_infinite | is_impossible, np.nan, column)


def _check_unit(
    channel: str, column: np.ndarray, is_impossible: np.ndarray, limit: float, now: str
) -> None:
    """Refuse many impossible values, unless all are one number, which then means missing.

    The unit that would make them likely is named, in place of the one of now, if it is the only
    one.
    Of a command, those at zero do not count: a rudder is amidships for most of a mission.
    """
    is_known = np.isfinite(column)
    is_counted = is_known & (column != 0.0) if channel in COMMANDS else is_known
    impossible = column[is_impossible]
    is_missing_mark = impossible.size < is_known.sum() and (impossible == impossible[0]).all()
    if impossible.size < WRONG_UNIT * is_counted.sum() or is_missing_mark:
        return
    unit = CHANNELS[channel].unit
    typical = float(np.median(abs(impossible)))
    column_value = typical / UNITS[unit][now]
    fitting = [
        name
        for name, factor in UNITS[unit].items()
        if LEAST_SHARE * limit < column_value * factor < limit
    ]
    hint = f" ({fitting[0]}?)" if len(fitting) == 1 else ""
    raise refusal(
        channel,
        f"{typical:.6g} {unit} and the like",
        f"up to {limit:.3g} {unit}, of which this is {typical / limit:.3g} times",
        f"correct unit or scale of [channels.{channel}]{hint}, or [parameters]",
    )


def _remark_missing_or_constant(channel: str, column: np.ndarray, remarks: list[str]) -> None:
    known = column[np.isfinite(column)]
    n_missing = column.size - known.size
    if known.size == 0:
        remarks.append(f"{channel}: never read")
    elif n_missing:
        remarks.append(f"{channel}: missing in {n_missing} of {column.size} rows")
    if known.size > 1 and (known == known[0]).all():
        unit = CHANNELS[channel].unit
        remarks.append(f"{channel}: constant at {known[0]:.6g} {unit} throughout")


def _remark_disagreement(
    values: Mapping[str, np.ndarray], vehicle: VehicleFile, remarks: list[str]
) -> None:
    """Remark where speed or voltage disagree with the shaft speed by a factor as of a unit."""
    disagreement = OF_PRESET if vehicle.relations is None else OF_CALIBRATED
    for side in SIDES:
        rpm = f"{side}_rpm"
        ratios = _ratios(side, values, vehicle)
        explained = disagreement.explained
        units = _explanations(ratios, rpm, values, vehicle, explained, explained)
        explanation = ""
        if len(units) == 1:
            changed, unit = units[0]
            name = "shaft speed" if changed == rpm else changed
            explanation = f", as if with {name} in {unit}"
        for channel, ratio in ratios.items():
            if not 1 / disagreement.least < ratio < disagreement.least:
                remark = f"{channel} is {ratio:.3g} times what {rpm} gives with these constants"
                remarks.append(f"{remark}{explanation}; are the units right?")


def other_unit(values: Mapping[str, np.ndarray], vehicle: VehicleFile) -> tuple[str, str] | None:
    """A channel and its unit, if it is almost surely in that unit and not in the file's.

    The vehicle is calibrated, and in every part of the log in which a shaft turns that unit, and no
    other, brings the speed within the factor `SURELY` of what the shaft speed gives, and voltages,
    which fall across the resistance too, within that of a remark. A fault begins at some time, and
    its factor is that of no unit. A side that agrees with the speed shows that the other's shaft
    speed is wrong, not the unit of the speed. `values` are by channel, (n_rows,).
    """
    if vehicle.relations is None:
        return None
    found: list[tuple[str, str]] = []
    speed_agrees = False
    n_rows = len(next(iter(values.values())))
    for side in SIDES:
        of_side = set()
        for k in range(PARTS):
            rows = slice(k * n_rows // PARTS, (k + 1) * n_rows // PARTS)
            part = {channel: column[rows] for channel, column in values.items()}
            ratios = _ratios(side, part, vehicle)
            if ratios:
                of_side.add(_explained(ratios, f"{side}_rpm", part, vehicle))
        if of_side <= {AGREES}:
            speed_agrees = speed_agrees or bool(of_side)
            continue
        units = of_side.pop()
        if of_side or len(units) != 1:
            return None
        found += units
    # both shaft speeds can be in another unit, or the speed by both
    kinds = {(channel.rpartition("_")[2], unit) for channel, unit in found}
    is_contradicted = speed_agrees and "speed" in dict(found)
    return found[0] if len(kinds) == 1 and not is_contradicted else None


def _explained(
    ratios: Mapping[str, float], rpm: str, values: Mapping[str, np.ndarray], vehicle: VehicleFile
) -> tuple[tuple[str, str], ...]:
    """The changes of a unit that surely explain the ratios; `AGREES` where there is nothing to."""
    least = OF_CALIBRATED.least
    if all(1 / least < ratio < least for ratio in ratios.values()):
        return AGREES
    return tuple(_explanations(ratios, rpm, values, vehicle, least, SURELY))


def _ratios(side: str, values: Mapping[str, np.ndarray], vehicle: VehicleFile) -> dict[str, float]:
    """Typical ratios of speed and voltage to what the shaft speed of a side gives."""
    per_rpm = {
        "speed": _speed_per_rpm(vehicle.vehicle),
        f"{side}_voltage": vehicle.vehicle.torque_constant / RPM,
    }
    ratios = {}
    for channel, scale in per_rpm.items():
        ratio = _typical_ratio(values.get(channel), values.get(f"{side}_rpm"), scale)
        if ratio:
            ratios[channel] = ratio
    return ratios


def _remark_turned_sign(values: Mapping[str, np.ndarray], remarks: list[str]) -> None:
    """Remark a current that is mostly negative while its shaft turns forward."""
    for side in SIDES:
        current = values.get(f"{side}_current")
        rpm = values.get(f"{side}_rpm")
        if current is None or rpm is None:
            continue
        is_driven = np.isfinite(current) & _is_turning(rpm) & (rpm > 0.0)
        if is_driven.any() and np.median(current[is_driven]) < 0.0:
            remarks.append(
                f"{side}_current: negative while its shaft turns forward; is its sign right?"
            )


def _typical_ratio(column: np.ndarray | None, rpm: np.ndarray | None, scale: float) -> float | None:
    """Median ratio of a reading to the one that the shaft speed implies, while the shaft turns."""
    if column is None or rpm is None or not scale:
        return None
    is_turning = np.isfinite(column) & (column != 0) & _is_turning(rpm)
    if is_turning.sum() <= 10:
        return None
    return float(np.median(abs(column[is_turning] / (scale * rpm[is_turning]))))


def _is_turning(rpm: np.ndarray) -> np.ndarray:
    """Where the shaft turns, (n_rows,)."""
    is_known = np.isfinite(rpm)
    fastest = np.max(abs(rpm), where=is_known, initial=0.0)
    return is_known & (abs(rpm) > TURNING * fastest)


def _explanations(
    ratios: Mapping[str, float],
    rpm: str,
    values: Mapping[str, np.ndarray],
    vehicle: VehicleFile,
    explained: float,
    of_speed: float,
) -> list[tuple[str, str]]:
    """Each channel and unit with which all agree and are within reach.

    Voltages agree within the factor `explained`, the speed within `of_speed`.
    """
    if not ratios:
        return []
    reach = _reach(vehicle.vehicle)
    is_turning = _is_turning(values[rpm])
    shares = {
        channel: np.nanmedian(abs(values[channel][is_turning])) / reach[CHANNELS[channel].unit]
        for channel in (rpm, *ratios)
    }
    explanations = []
    for changed in shares:
        kind = CHANNELS[changed].unit
        now = unit_of(vehicle.columns[changed], kind)
        for unit in UNITS[kind]:
            factor = UNITS[kind][unit] / UNITS[kind][now]
            new_shares = shares | {changed: shares[changed] * factor}
            limits = {one: of_speed if one == "speed" else explained for one in ratios}
            new_ratios = {
                one: ratio / factor
                if changed == rpm
                else ratio * factor
                if changed == one
                else ratio
                for one, ratio in ratios.items()
            }
            agrees = all(1 / limits[one] < ratio < limits[one] for one, ratio in new_ratios.items())
            is_likely = all(LEAST_SHARE < share < 1.0 for share in new_shares.values())
            if unit != now and agrees and is_likely:
                explanations.append((changed, unit))
    return explanations
