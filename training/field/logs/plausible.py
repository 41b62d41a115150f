"""Whether the readings of a log can be those of the vehicle: infinite, impossible, missing, constant, a wrong unit."""

import math

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import refusal
from auv_fault_env.parameters import Vehicle
from auv_fault_env.physics import RPM
from training.field.units import STANDARD_GRAVITY, UNITS
from training.field.vehicle_file import VehicleFile

IMPOSSIBLE = 2.0  # times the largest value that sensor or vehicle can come to
# share of impossible values from which it is not they that are wrong, but the unit
WRONG_UNIT = 0.05
DISAGREE = 3.0  # factor between two readings from which one of them may be in another unit


def largest(vehicle: Vehicle) -> dict[str, float]:
    """The largest magnitude [unit of the channel] by channel: full scale, or what the vehicle can reach if it is more.

    Rough on purpose: shaft speed without load, current at stall, speed without slip, gravity on a
    tilted accelerometer, any deflection of a fin.
    """
    rpm = vehicle.maximum_voltage / vehicle.torque_constant * RPM
    speed = rpm * math.sqrt(vehicle.beta / -vehicle.alpha)
    reach = {"m/s": speed, "m/s^2": STANDARD_GRAVITY, "rad": math.pi / 2, "rpm": rpm}
    reach |= {"V": vehicle.maximum_voltage, "A": vehicle.maximum_voltage / vehicle.resistance}
    return {
        name: max(-channel.low, channel.high, reach[channel.unit])
        for name, channel in CHANNELS.items()
    }


def plausible(
    values: dict[str, np.ndarray], vehicle: VehicleFile, repairs: list[str]
) -> dict[str, np.ndarray]:
    """The values by channel (n_rows,), NaN where none can have been read.

    Raises
    ------
    InputError
        If a channel is in another unit than the vehicle's file says, or if no reading is left.
    """
    limits = largest(vehicle.vehicle)
    values = {
        channel: _possible(channel, column, limits[channel], repairs)
        for channel, column in values.items()
    }
    for channel in filter(values.__contains__, READINGS):
        _look(channel, values[channel], repairs)
    if not any(np.isfinite(values[channel]).any() for channel in values if channel in READINGS):
        raise refusal(
            "log", "no reading", "at least one number in a column of a reading", "see its columns"
        )
    _compare(values, vehicle.vehicle, repairs)
    return values


def _possible(channel: str, column: np.ndarray, limit: float, repairs: list[str]) -> np.ndarray:
    unit = CHANNELS[channel].unit
    infinite = np.isinf(column)
    size = abs(column)
    impossible = (size > IMPOSSIBLE * limit) & ~infinite
    beyond = (size > limit) & ~impossible & ~infinite
    if infinite.any():
        repairs.append(f"{channel}: infinite values taken as missing ({infinite.sum()})")
    if beyond.any():
        highest = size[beyond].max()
        repairs.append(
            f"{channel}: values beyond {limit:.3g} {unit}, up to {highest:.3g}, kept ({beyond.sum()})"
        )
    if impossible.any():
        _check_unit(channel, column, impossible, limit)
        shown = column[impossible][0]
        said = (
            f"impossible values, such as {shown:.6g} {unit}, taken as missing ({impossible.sum()})"
        )
        repairs.append(f"{channel}: {said}")
    return np.where(infinite | impossible, np.nan, column)


def _check_unit(channel: str, column: np.ndarray, impossible: np.ndarray, limit: float) -> None:
    """Refuse many impossible values, unless they are one number that stands for missing among possible ones."""
    known = np.isfinite(column).sum()
    odd = column[impossible]
    if impossible.sum() < WRONG_UNIT * known or (odd.size < known and (odd == odd[0]).all()):
        return
    unit = CHANNELS[channel].unit
    typical = float(np.median(abs(odd)))
    fitting = [name for name, scale in UNITS[unit].items() if typical * scale < limit]
    allowed = f"up to {limit:.3g} {unit}, of which this is {typical / limit:.3g} times"
    remedy = f"correct unit or scale of [channels.{channel}]" + (
        f" ({' or '.join(fitting)}?)" if fitting else ""
    )
    raise refusal(
        channel, f"{typical:.6g} {unit} and the like", allowed, remedy + ", or [parameters]"
    )


def _look(channel: str, column: np.ndarray, repairs: list[str]) -> None:
    known = column[np.isfinite(column)]
    if known.size == 0:
        repairs.append(f"{channel}: never read")
    elif known.size < column.size:
        repairs.append(f"{channel}: missing in {column.size - known.size} of {column.size} rows")
    if known.size > 1 and (known == known[0]).all():
        repairs.append(f"{channel}: constant at {known[0]:.6g} {CHANNELS[channel].unit} throughout")


def _compare(values: dict[str, np.ndarray], vehicle: Vehicle, repairs: list[str]) -> None:
    """Say where speed or voltage do not fit the shaft speed, by a factor that another unit would explain."""
    per_rpm = {
        "speed": math.sqrt(vehicle.beta / -vehicle.alpha),
        "voltage": vehicle.torque_constant / RPM,
    }
    for side in ("port", "starboard"):
        for channel, scale in (
            ("speed", per_rpm["speed"]),
            (f"{side}_voltage", per_rpm["voltage"]),
        ):
            ratio = _ratio(values.get(channel), values.get(f"{side}_rpm"), scale)
            if ratio and not 1 / DISAGREE < ratio < DISAGREE:
                said = f"{channel} is {ratio:.3g} times what {side}_rpm gives with these constants"
                repairs.append(f"{said}{_explained(ratio, channel)}; are the units right?")


def _ratio(column: np.ndarray | None, rpm: np.ndarray | None, scale: float) -> float | None:
    """Typical ratio of a reading to what the shaft speed would give, while the shaft turns."""
    if column is None or rpm is None or not scale:
        return None
    known = np.isfinite(column) & np.isfinite(rpm) & (column != 0)
    turning = known & (abs(rpm) > 0.1 * np.max(abs(rpm), where=known, initial=0.0))
    return (
        float(np.median(abs(column[turning] / (scale * rpm[turning]))))
        if turning.sum() > 10
        else None
    )


def _explained(ratio: float, channel: str) -> str:
    """The unit whose factor is nearest to the ratio, if one is near."""
    named = {
        f"{channel} in {unit}": 1 / scale for unit, scale in UNITS[CHANNELS[channel].unit].items()
    }
    named |= {f"shaft speed in {unit}": scale for unit, scale in UNITS["rpm"].items()}
    distance = {
        words: abs(math.log(ratio / scale)) for words, scale in named.items() if scale != 1.0
    }
    nearest = min(distance, key=lambda words: distance[words])
    return f", as if with {nearest}" if distance[nearest] < math.log(2) else ""
