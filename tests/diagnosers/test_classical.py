"""Limits, CUSUM and rules are quiet on healthy vehicles, and find and name severe faults."""

import numpy as np
import pytest

from auv_fault_env.faults import CATALOGUE, Fault, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import SIDES
from auv_fault_env.schedules import FaultEvent
from diagnosers import make
from training.rollouts import roll_out

N_HEALTHY = 24  # lanes
ONSET = 8.0  # s
SEVERE = {
    "increased_drag": 1.0,
    "propeller_loss:port": 1.0,
    "seal_friction:starboard": 1.0,
    "sensor_dropout:speed": 0.5,
    "sensor_stuck:port_rpm": 1.0,
    "sensor_noise:starboard_current": 1.0,
    "sensor_bias:acceleration": 1.0,
    "sensor_bias:port_voltage": 1.0,
}


def run(schedules, first_seed, n_samples=300):
    """Observations (n_samples, n_lanes, n_channels) of the thesis' mission."""
    n_lanes = len(schedules)
    seeds = range(first_seed, first_seed + n_lanes)
    return roll_out(
        Fleet(n_lanes), seeds, n_samples, None, schedules, ["thesis"] * n_lanes
    ).observations


@pytest.fixture(scope="module", params=["limits", "cusum", "rules"])
def diagnoser(request):
    return make(request.param)


def follow(diagnoser, observations):
    diagnoser.reset(observations.shape[1])
    return [diagnoser.update(observation) for observation in observations]


def test_healthy_vehicles_stay_normal(diagnoser):
    quiet = np.array(
        [belief.log_probability[:, 0] for belief in follow(diagnoser, run([()] * N_HEALTHY, 0))]
    )
    assert (quiet > -3.0).all()
    assert (quiet > np.log(0.5)).mean() > 0.99


def surest(diagnoser, observations):
    """Log probabilities (n_lanes, n_classes) when the fault of each lane is most probable."""
    beliefs = np.array([belief.log_probability for belief in follow(diagnoser, observations)])
    return beliefs[beliefs[..., 0].argmin(axis=0), np.arange(beliefs.shape[1])]


def test_severe_faults_are_detected_and_named(diagnoser):
    schedules = [(FaultEvent(fault, ONSET, severity),) for fault, severity in SEVERE.items()]
    log_probability = surest(diagnoser, run(schedules, 100))
    named = [classes()[k] for k in log_probability.argmax(axis=1)]
    wanted = [CATALOGUE[fault].diagnosis for fault in SEVERE]
    assert sum(got == want for got, want in zip(named, wanted, strict=True)) >= len(SEVERE) - 1, (
        named
    )
    assert (log_probability[:, 0] < -3.0).all() and log_probability[:, 0].min() < -50.0


def test_a_new_fault_gets_its_signature_without_an_edit(monkeypatch):
    scale = {
        f"{side}_{name}": value
        for side in SIDES
        for name, value in (("resistance", 1.4), ("torque_constant", 0.8))
    }
    monkeypatch.setitem(CATALOGUE, "both_hot", Fault("both_hot", "motors", scale=scale))
    log_probability = surest(make("cusum"), run([(FaultEvent("both_hot", ONSET, 0.8),)] * 2, 300))
    assert (log_probability.argmax(axis=1) == classes().index("both_hot")).all()


def test_severity_grows_with_the_fault(diagnoser):
    severities = [0.3, 0.6, 1.0]
    schedules = [
        (FaultEvent("seal_friction:port", ONSET, severity),)
        for severity in severities
        for _ in range(4)
    ]
    belief = follow(diagnoser, run(schedules, 200))[-1]
    found = (
        belief.severity_mean[:, classes().index("seal_friction:port")].reshape(3, 4).mean(axis=1)
    )
    assert found[0] < found[1] < found[2]
    assert found[2] - found[0] > 0.2
