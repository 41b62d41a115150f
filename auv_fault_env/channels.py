"""The channels of an observation, in order: commands and readings with unit, range and noise.

The first four are commands, the other eight are readings. Shaft speed is in rpm, as in every
vehicle log.
"""

from typing import NamedTuple


class Channel(NamedTuple):
    """One element of an observation.

    Readings saturate at `low` and `high`, which in `CHANNELS` are those of `thesis1992`
    (`parameters.channels_of` has those of any vehicle); `noise` is the default standard deviation.
    """

    unit: str
    low: float
    high: float
    noise: float
    about: str


# m/s, largest surge speed command of thesis1992: twice the 1.5 ft/s of the thesis; the plant
# reaches 2.7 at 24 V
MAXIMUM_COMMAND = 1.0
MAXIMUM_DEFLECTION = 0.4  # rad, rudder and stern plane

# Noise defaults are those of common parts, not the thesis' (it reports none):
# paddle wheel 1 cm/s; accelerometer 100 ug/sqrt(Hz) over 5 Hz; 10-bit converters on 24 V and 25 A;
# rpm counter 1 rpm.
CHANNELS: dict[str, Channel] = {
    "mission_speed": Channel("m/s", 0.0, MAXIMUM_COMMAND, 0.0, "speed the mission asks for"),
    "speed_command": Channel(
        "m/s", 0.0, MAXIMUM_COMMAND, 0.0, "surge speed commanded to the controller"
    ),
    "rudder": Channel("rad", -MAXIMUM_DEFLECTION, MAXIMUM_DEFLECTION, 0.0, "rudder deflection"),
    "stern_plane": Channel(
        "rad", -MAXIMUM_DEFLECTION, MAXIMUM_DEFLECTION, 0.0, "stern plane deflection"
    ),
    "speed": Channel("m/s", -1.0, 5.0, 0.01, "surge speed from the paddle wheel"),
    "acceleration": Channel("m/s^2", -2.0, 2.0, 0.002, "surge acceleration from the accelerometer"),
    "port_voltage": Channel("V", -5.0, 30.0, 0.025, "voltage at the port motor"),
    "port_current": Channel("A", -30.0, 30.0, 0.025, "current of the port motor"),
    "port_rpm": Channel("rpm", -500.0, 6000.0, 1.0, "port shaft speed"),
    "starboard_voltage": Channel("V", -5.0, 30.0, 0.025, "voltage at the starboard motor"),
    "starboard_current": Channel("A", -30.0, 30.0, 0.025, "current of the starboard motor"),
    "starboard_rpm": Channel("rpm", -500.0, 6000.0, 1.0, "starboard shaft speed"),
}
COMMANDS: tuple[str, ...] = tuple(CHANNELS)[:4]
READINGS: tuple[str, ...] = tuple(CHANNELS)[4:]
# column of each channel in an observation
INDEX: dict[str, int] = {name: column for column, name in enumerate(CHANNELS)}
