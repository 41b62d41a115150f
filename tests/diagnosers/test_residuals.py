"""The relations of the simulated vehicle, which are the default."""

import math

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX, READINGS
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from diagnosers.diagnoser import LARGEST_READING
from diagnosers.relations.model import residuals_of
from diagnosers.relations.windows import BALANCE, windows_of
from training.rollouts import roll_out
from training.seeds import seeds

LEGS = Mission(((0.0, 0.3), (40.0, 0.5), (60.0, 0.35)))
N_SAMPLES = 800
ONSET = 20.0  # s
LOG_ALARM = math.log(0.5)


def observations(n_lanes, *events):
    """(n_samples, n_lanes, n_channels)."""
    lanes = seeds("validation", n_lanes, 95_000)
    fleet = Fleet(n_lanes, realism=1.0)
    rolled = roll_out(fleet, lanes, N_SAMPLES, None, [events] * n_lanes, [LEGS] * n_lanes)
    return rolled.observations.astype(float)


def log_probability(rows):
    """(n_samples, n_lanes, n_classes)."""
    diagnoser = make("residuals")
    diagnoser.reset(rows.shape[1])
    return np.stack([diagnoser.update(row).log_probability for row in rows])


@pytest.mark.parametrize(
    ("fault", "severity"),
    [
        ("seal_friction:port", 0.6),
        ("propeller_loss:starboard", 1.0),
        ("motor_overheating:port", 0.9),
        ("sensor_scale:starboard_voltage", 0.9),
        ("sensor_bias:port_current", 0.9),
        ("sensor_dropout:starboard_rpm", 0.9),
    ],
)
def test_vehicles_of_the_band_get_an_alarm_after_the_onset_and_the_right_name(fault, severity):
    belief = log_probability(observations(8, FaultEvent(fault, ONSET, severity)))
    is_alarm = belief[:, :, 0] < LOG_ALARM
    assert not is_alarm[: int(10 * ONSET)].any()
    right = classes().index(CATALOGUE[fault].diagnosis)
    named = 1 + belief[-1, :, 1:].argmax(axis=1)
    assert np.count_nonzero(is_alarm[-1] & (named == right)) >= 6


@pytest.mark.parametrize("channel", CHANNELS)
def test_a_channel_that_is_never_read_leaves_the_other_relations(channel):
    rows = observations(2, FaultEvent("seal_friction:port", ONSET, 0.9))
    rows[:, :, INDEX[channel]] = np.nan
    belief = log_probability(rows)
    assert np.isfinite(belief).all()
    assert not (belief[: int(10 * ONSET), :, 0] < LOG_ALARM).any()
    if channel not in ("speed", "port_current", "port_rpm"):
        assert (belief[-1, :, 0] < LOG_ALARM).all()


def test_a_single_reading_that_is_far_off_changes_no_belief():
    good = observations(1)[:400]
    rows = np.repeat(good, len(READINGS), axis=1)
    for lane, name in enumerate(READINGS):
        rows[250, lane, INDEX[name]] = 0.9 * LARGEST_READING[INDEX[name]]
    difference = np.exp(log_probability(rows)) - np.exp(log_probability(good))
    assert np.abs(difference).max() < 0.05


def test_the_same_error_of_a_voltage_counts_the_same_where_the_shafts_stand():
    model = make("residuals").model
    rows = np.zeros((2, model.layout.n_rows, len(CHANNELS)))
    rows[:, :, INDEX["speed"]] = 0.3
    for side in model.layout.sides:
        shaft = np.array([0.0, 0.4])  # 1000 rpm
        current = 0.35
        constant, back_emf, resistance = model.coefficients[f"{side}_voltage"]
        voltage = constant + back_emf * shaft + resistance * current
        rows[:, :, INDEX[f"{side}_rpm"]] = 1000.0 * shaft[:, None]
        rows[:, :, INDEX[f"{side}_current"]] = current
        rows[:, :, INDEX[f"{side}_voltage"]] = voltage[:, None]
    rows[:, :, INDEX["port_voltage"]] += 0.05
    windows = windows_of(rows, model.layout, model.typical)
    residual, _ = residuals_of(model.layout, model.coefficients, windows)
    balance = residual[:, model.layout.residuals.index(BALANCE)]
    np.testing.assert_allclose(balance, 0.05, rtol=0.2)
