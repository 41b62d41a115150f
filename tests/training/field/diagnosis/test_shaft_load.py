import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import FaultEvent
from training.field.diagnosis.shaft_load import excess_load, healthy_current
from training.rollouts import roll_out

NAMES = list(CHANNELS)
VEHICLE = PRESETS["thesis1992"]


def readings(fault=None, **fleet):
    """Voltage, current and speed of the port side, (n_samples,) each, over 30 s; the fault is there
    from the start.
    """
    schedule = (FaultEvent(fault, 0.0, 1.0),) if fault else ()
    fleet = Fleet(1, healthy_band=0.0, **fleet)
    rolled = roll_out(fleet, [5], 300, schedules=[schedule], missions=[MISSIONS["thesis"]])
    columns = (NAMES.index(name) for name in ("port_voltage", "port_current", "speed"))
    return [rolled.observations[:, 0, column].astype(float) for column in columns]


def test_a_healthy_motor_draws_what_is_expected():
    voltage, current, speed = readings(sensor_noise=0.0)
    np.testing.assert_allclose(healthy_current(voltage, speed, VEHICLE)[1:], current[1:], atol=0.02)


@pytest.mark.parametrize(
    ("fault", "low", "high"),
    [
        (None, -0.05, 0.05),
        ("seal_friction:port", 0.3, 5.0),
        ("propeller_loss:port", -0.9, -0.2),
        ("seal_friction:starboard", -0.05, 0.05),
    ],
)
def test_the_sign_says_whether_the_load_is_more_or_less(fault, low, high):
    voltage, current, speed = readings(fault)
    assert low < excess_load(current, healthy_current(voltage, speed, VEHICLE)) < high


def test_the_last_reading_replaces_a_missing_one():
    voltage, _, speed = readings()
    sparse = [np.where(np.arange(300) % 10 == 0, values, np.nan) for values in (voltage, speed)]
    held = [values[np.arange(300) // 10 * 10] for values in (voltage, speed)]
    np.testing.assert_array_equal(
        healthy_current(*sparse, VEHICLE), healthy_current(*held, VEHICLE)
    )


def test_without_a_current_or_a_voltage_there_is_no_load():
    assert excess_load(np.full(3, np.nan), np.ones(3)) is None
    assert excess_load(np.ones(3), np.zeros(3)) is None
    assert excess_load(np.array([1.5, np.nan]), np.array([1.0, 7.0])) == pytest.approx(0.5)
