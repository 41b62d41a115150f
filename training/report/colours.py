"""The colours and markers of all figures and of the live page.

Those of `COLOURS`, and those of the classes, also differ for eyes that lack one kind of cones.
"""

from auv_fault_env.faults import NORMAL, UNKNOWN

PORT = "#b3261e"
STARBOARD = "#12a67c"
SPEED = "#1f4e79"
COMMAND = "#8a949e"
TRUTH = "#111111"
COLOURS = (
    PORT,
    SPEED,
    STARBOARD,
    "#ff6000",
    "#af50bf",
    "#0080ff",
    "#602000",
    "#ff70bf",
    "#707070",
    "#9f9fff",
    "#6000ef",
    "#0000af",
)
CLASS_COLOURS = {
    NORMAL: TRUTH,
    "increased_drag": "#0070ff",
    "decreased_drag": "#00bf80",
    "propeller_damage:port": "#ff4030",
    "propeller_loss:port": "#801040",
    "seal_friction:port": "#df9f00",
    "motor_overheating:port": "#705000",
    "propeller_damage:starboard": "#608f20",
    "propeller_loss:starboard": "#004000",
    "seal_friction:starboard": "#007080",
    "motor_overheating:starboard": "#808fff",
    "sensor:speed": "#0000ff",
    "sensor:acceleration": "#20108f",
    "sensor:port_voltage": "#bf1050",
    "sensor:port_current": "#df8fcf",
    "sensor:port_rpm": "#af50bf",
    "sensor:starboard_voltage": "#500060",
    "sensor:starboard_current": "#8000bf",
    "sensor:starboard_rpm": "#504080",
    UNKNOWN: "#7f8c8d",
}
SENSORS = "sensor:"  # begins the classes of sensors
ADDED_CLASS = "#b8860b"  # of a fault that a user has added to the catalogue
SOLID = "solid"
DASHED = "dashed"
DOTTED = "dotted"
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


def class_style(name: str) -> tuple[str, str]:
    """Colour and dash of a diagnosis class, the same in every chart: sensors are dashed."""
    colour = CLASS_COLOURS.get(name, ADDED_CLASS)
    if name == UNKNOWN:
        return colour, DOTTED
    is_solid = name in CLASS_COLOURS and not name.startswith(SENSORS)
    return colour, SOLID if is_solid else DASHED
