"""The vehicle of a vehicle file, as simulations and filter banks take it."""

from dataclasses import replace

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import refusal
from auv_fault_env.missions import MissionSampler
from auv_fault_env.parameters import SIDES
from diagnosers.kalman import NOISE_FLOOR
from training.field.vehicle_file import VehicleFile
from training.logged_vehicle import LoggedVehicle

MISSION_SPEEDS = (0.2, 1.0)  # of its missions, in terms of the largest command


def logged_vehicle(file: VehicleFile) -> LoggedVehicle:
    """The vehicle of a file with what its logs show; starboard without a reading turns as port."""
    sides = logged_sides(file)
    absent = (channel for channel in READINGS if channel not in file.columns)
    absent_sides = (side for side in SIDES if side not in sides)
    # a voltage computed from a command and the supply is no sensor that fails
    computed = (channel for channel, column in file.columns.items() if column.times)
    channels = (channel for channel in CHANNELS if channel in file.columns)
    return LoggedVehicle(
        vehicle=replace(file.vehicle, shafts=len(sides)),
        band=dict(file.band),
        noise={
            reading: max(std, NOISE_FLOOR * CHANNELS[reading].noise)
            for reading, std in file.noise.items()
        },
        channels=tuple(channels),
        sample_rate=file.sample_rate,
        missions=MissionSampler(speed=MISSION_SPEEDS),
        hidden=tuple(f"{name}_" for name in (*absent, *absent_sides, *computed)),
    )


def logged_sides(file: VehicleFile) -> tuple[str, ...]:
    """Sides with a voltage or a shaft speed; starboard without either turns as port."""
    sides = tuple(
        side for side in SIDES if {f"{side}_voltage", f"{side}_rpm"} & file.columns.keys()
    )
    if SIDES[0] not in sides:
        allowed = "port_voltage or port_rpm among them"
        raise refusal("channels", list(file.columns), allowed, "name the column of either")
    return sides
