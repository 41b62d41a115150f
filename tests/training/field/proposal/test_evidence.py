import numpy as np
import pytest

from tests.training.field.proposal.missions import SPEED, TIME
from training.field.proposal.evidence import Refused, match_of
from training.field.proposal.header import name_of
from training.field.proposal.sides import side_marks
from training.field.proposal.symbols import context_of

# names that logs have, and what they are: quantity, mark of the side, unit
NAMES = {
    "u_mps": ("speed", None, "m/s"),
    "Speed [kn]": ("speed", None, "kn"),
    "speed (ft/s)": ("speed", None, "ft/s"),
    "u_velo [m/s]": ("speed", None, "m/s"),
    "surge_m_s": ("speed", None, "m/s"),
    "speed_ms": ("speed", None, "m/s"),
    "speed_meters_per_sec": ("speed", None, "m/s"),
    "STW": ("speed", None, None),
    "SOG": ("speed", None, None),
    "vx": ("speed", None, None),
    "v_water": ("speed", None, None),
    "Vehicle Speed": ("speed", None, None),
    "Speed, kn": ("speed", None, "kn"),
    "speed m/s": ("speed", None, "m/s"),
    "Speed (over ground) [kn]": ("speed", None, "kn"),
    "Drehzahl U/min": ("rpm", None, "rpm"),
    "n in 1/min": ("rpm", None, "rpm"),
    "Strom BB in A": ("current", "port", "A"),
    "PWM [-]": ("duty", None, None),
    "rpm_port": ("rpm", "port", "rpm"),
    "StbdRPM": ("rpm", "starboard", "rpm"),
    "n_stbd": ("rpm", "starboard", None),
    "n_prop [rps]": ("rpm", None, "rev/s"),
    "motor 2 speed (rad/s)": ("rpm", 2, "rad/s"),
    "prop_speed": ("rpm", None, None),
    "T3_rpm": ("rpm", 3, "rpm"),
    "esc[7].rpm": ("rpm", 7, "rpm"),
    "thruster1_current_A": ("current", 1, "A"),
    "i_left_mA": ("current", "port", "mA"),
    "mtr_cur_mA": ("current", None, "mA"),
    "esc_current0": ("current", 0, None),
    "left_mA": ("current", "port", "mA"),
    "V_port": ("voltage", "port", None),
    "U_port": ("voltage", "port", None),
    "mtr_V": ("voltage", None, "V"),
    "bus_V": ("supply_voltage", None, "V"),
    "V_bat": ("supply_voltage", None, None),
    "Batt Ampers": ("supply_current", None, None),
    "Right motor voltage [V]": ("voltage", "starboard", "V"),
    "a_x": ("acceleration", None, None),
    "surge accel (g)": ("acceleration", None, "g"),
    "delta_rudder [rad]": ("rudder", None, "rad"),
    "stern_plane_deg": ("stern_plane", None, "deg"),
    "speed_setpoint_kn": ("speed_command", None, "kn"),
    "cmd_vx": ("speed_command", None, None),
    "accel_m_s2": ("acceleration", None, "m/s^2"),
    "v_set": ("speed_command", None, None),
    "mission_speed": ("mission_speed", None, None),
    "pwm2": ("duty", 2, None),
    "thr_left_pwm": ("duty", "port", None),
    "rpm_cmd_port": ("rpm_command", "port", "rpm"),
    "Motor Speed CMD": ("rpm_command", None, None),
    "Motorstrom BB [A]": ("current", "port", "A"),
    "Sollgeschwindigkeit": ("speed_command", None, None),
    "Vitesse de rotation hélice": ("rpm", None, None),
    "Tensión": ("voltage", None, None),
    "左电机电流(mA)": ("current", "port", "mA"),
    "n_ist": ("rpm", None, None),
    "shaft_speed_rads": ("rpm", None, "rad/s"),
    "speed_cms": ("speed", None, "cm/s"),
}
# names of other quantities, and a word of the reason; an empty one where nothing is known
OTHERS = {
    "amp_hours_used": "charge",
    "battery_mAh": "charge",
    "motor_current_limit": "limit",
    "current_speed": "sea",
    "Current Speed": "sea",
    "current_dir": "sea",
    "Current Step": "count",
    "n/a": "",
    "Concentration[uM]": "water or parts",
    "foo [uM]": "",
    "speed [uM]": "no unit of speed",
    "motor_current [V]": "no unit of current",
    "rpm [A]": "no unit of rpm",
    "Speed of Sound": "sound",
    "Schallgeschwindigkeit": "sound",
    "声速": "sound",
    "wind/speed": "wind",
    "wind_velo_true [m/s]": "wind",
    "thr_left_pwm_zero_point": "setting",
    "cell1_voltage": "parts",
    "cells[1].voltage": "parts",
    "rpm_fore": "bow or stern",
    "aft thruster current": "bow or stern",
    "speed_error": "error",
    "left_speed": "one side",
    "motor_current_setpoint": "command",
    "motor_temp_V": "temp",
    "current_rpm_port": "could be",
    "yaw_rate_setpoint": "turning",
    "psi_hat [rad]": "direction",
    "r_angvelo [rad/s]": "turning",
    "depth": "direction or place",
    "a.b": "",
    "": "",
    "x [m]": "",
    "v_of_something_strange": "could be",
    "n_packets": "",
    "current_task": "",
    "speed_knob": "",
    "bilge_pump_current": "another device",
    "fan/rpm": "another device",
    "port_fwd_rpm": "bow or stern",
    "motor voltage x10": "scaled",
    "shaft rpm /100": "scaled",
    "motor_current_dA": "no unit of current",
    "motor voltage [cV]": "no unit of voltage",
    "vitesse fond (nd)": "no unit of speed",
    "vel_n": "direction or place",
    "speed_n": "",
    "n_speed": "",
    "climb_speed": "turning",
    "cross speed": "turning",
    "\\x83\\x82[\\x83^1 current [A]": "encoding",
}


def outcome(label, values=None):
    names = {label: name_of(label)}
    name = names[label]
    values = TIME if values is None and "time" in name.quantities else values
    values = SPEED if values is None else values
    return match_of(label, name, side_marks(names)[label], values, context_of(names))


@pytest.mark.parametrize("label", NAMES)
def test_quantity_side_and_unit_of_a_name(label):
    found = outcome(label)
    assert (found.quantity, found.mark, found.unit) == NAMES[label]


@pytest.mark.parametrize("label", OTHERS)
def test_names_of_other_quantities(label):
    found = outcome(label)
    assert isinstance(found, Refused)
    assert OTHERS[label] in found.why
    assert bool(OTHERS[label]) == bool(found.why)


# logs of symbols of one letter: their names, and which are the speed and the voltage
LETTERS = {
    "t u V I n": ("u", "V"),
    "t u U I n": ("u", "U"),
    "t v U I n": ("v", "U"),
    "t v i n": (None, "v"),
    "t u v r n": ("u", None),
    "t u v w p q r n U": ("u", None),
    "t u v i n": (None, None),
    "t v n": (None, None),
    "t U n": (None, None),
    "t U V n": ("U", None),
    "t V n": (None, None),
    "t V I n": (None, "V"),
    "speed u i n": ("speed", "u"),
    "speed V n": ("speed", "V"),
    "speed voltage U n": ("speed", "voltage"),
    "t u_p u_s speed": ("speed", "u_p"),
    "t ü rpm": ("ü", None),
    "t speed u1 u2": ("speed", None),
    "t speed u1 i1": ("speed", "u1"),
    "t speed U1 n1": ("speed", "U1"),
    "t v[m/s] rpm": ("v[m/s]", None),
    "t u v[m/s] rpm": ("u", None),
    "t v port_u stbd_u": ("v", "port_u"),
    "v v_set voltage n": ("v", "voltage"),
}


@pytest.mark.parametrize("header", LETTERS)
def test_symbols_by_the_other_columns(header):
    labels = header.split()
    names = {label: name_of(label) for label in labels}
    context = context_of(names)
    found = {}
    for label in labels:
        mark = side_marks(names)[label]
        match = match_of(label, names[label], mark, TIME if label == "t" else SPEED, context)
        if not isinstance(match, Refused):
            found.setdefault(match.quantity.removesuffix("_command"), label)
    assert (found.get("speed"), found.get("voltage")) == LETTERS[header]


TIMES = {
    "t": "s",
    "t [s]": "s",
    "Timestamp_ms": "ms",
    "time_us": "us",
    "Uhrzeit": None,
    "Fecha y hora": None,
    "iTOW": None,
    "HHMMSS": None,
    "GPS_SecondsOfWeek": "s",
    "time (seconds since 1970-01-01 00:00:00)": "s",
    "时间戳": None,
    "Time [h]": "h",
}


@pytest.mark.parametrize("label", TIMES)
def test_names_of_the_time(label):
    found = outcome(label, TIME)
    assert found.quantity == "time"
    assert found.unit == (None if label == "t" else TIMES[label])


# logs, and what their first column is beside the others
BESIDE = {
    "current, current_dir, speed": None,
    "courant, direction du courant, vitesse": None,
    "corriente, velocidad de la corriente, rpm": None,
    "motor current, current_dir, speed": "current",
    "current [A], current_dir, speed": "current",
    "current, depth, speed": "current",
    "vx, vy, u, v, w": None,
    "vx, vy, x, y, z": None,
    "odom/vx, odom/x, odom/y": None,
    "twist/vx, pose/x, pose/y": "speed",
    "vx, vy, vz": "speed",
}


@pytest.mark.parametrize("header", BESIDE)
def test_what_a_column_is_beside_others(header):
    names = {label: name_of(label) for label in header.split(", ")}
    label = next(iter(names))
    found = match_of(label, names[label], None, SPEED, context_of(names))
    assert (None if isinstance(found, Refused) else found.quantity) == BESIDE[header]
    assert not isinstance(found, Refused) or found.why


@pytest.mark.parametrize("label", ["Zulu", "recorded_at", "kl.", "Fix"])
def test_time_stamps_are_a_time_under_any_name(label):
    names = {label: name_of(label, "s")}
    for is_stamp in (True, False):
        found = match_of(label, names[label], None, TIME, context_of(names), is_stamp)
        assert isinstance(found, Refused) != is_stamp


VALUES = {
    "constant": ("rpm", np.full(600, 350.0), "constant at 350"),
    "empty": ("rpm", np.full(600, np.nan), "no number"),
    "a flag": ("motor_current", (SPEED > 0.5).astype(float), "only 0 and 1"),
    "a counter": ("i", np.arange(600.0), "counts up"),
    "sound": ("speed", 1500 + SPEED, "beyond every vehicle"),
    "a constant command": ("speed_setpoint", np.full(600, 1.5), "constant at 1.5"),
    "a constant motor command": ("pwm1", np.full(600, 1500.0), "constant at 1500"),
    "a time that falls": ("time_s", 100 - TIME, "does not grow"),
    "seconds of the minute": ("sec", TIME % 10, "does not grow"),
}


@pytest.mark.parametrize(("label", "values", "why"), VALUES.values(), ids=VALUES)
def test_values_that_exclude_a_column(label, values, why):
    if label == "speed":
        assert outcome(label, values).quantity == "speed"  # in mm/s, where no unit is named
        label = "speed [m/s]"
    assert why in outcome(label, values).why
