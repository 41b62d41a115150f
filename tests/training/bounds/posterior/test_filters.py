"""The evidence of the filters against integration over the healthy vehicle, by sampling."""

import math

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from auv_fault_env import physics
from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PARAMETERS, PRESETS, SAMPLE_TIME
from auv_fault_env.physics import RPM
from diagnosers.bank.algebra import covariance_row
from diagnosers.bank.hypotheses import OWN_PARAMETERS, PORT
from diagnosers.gaussian_bank import GaussianBank
from training.bounds.posterior import motor
from training.bounds.posterior.filters import PaddleWheel, VehicleFilters
from training.bounds.posterior.voltages import commanded_voltages
from training.rollouts import roll_out

N_SAMPLES = 120
N_DRAWS = 200
NAMES = ("port_rpm", "port_current", "port_voltage")
STATES = range(motor.FIRST_DEVIATION, motor.START_VOLTAGE + 1)


@pytest.fixture(scope="module")
def observations():
    fleet = Fleet(1)
    missions = [MISSIONS["thesis"]]
    rollout = roll_out(fleet, [11], N_SAMPLES, None, [()], missions)
    return rollout.observations[:, 0].astype(np.float64)


@pytest.fixture(scope="module")
def voltages(observations):
    return commanded_voltages(observations, physics.plant_constants(PRESETS["thesis1992"]))


@pytest.fixture(scope="module")
def filtered(observations, voltages):
    """Log evidence of the port motor, and mean and covariance of `STATES` at the end."""
    limits = np.array([[0.2, 1.0]])
    filters = VehicleFilters(
        GaussianBank(), ("sensor_bias:port_voltage",), limits, voltages, n_slots=1
    )
    port = filters.parts[0]
    evidence = 0.0
    for observation in observations:
        filters.step(observation, np.zeros((1, 1)))
        evidence += port.work.evidence[0]
    moments = port.filters[:, 0]
    mean = moments[list(STATES)]
    covariance = [[moments[covariance_row(i, j, motor.N_STATES)] for j in STATES] for i in STATES]
    return evidence, mean, np.array(covariance)


def log_likelihood(deviations, observations, speeds, voltages):
    """Log density of the readings of a motor whose healthy deviations are known."""
    vehicle = PRESETS["thesis1992"]
    constants = physics.plant_constants(vehicle)
    names = [OWN_PARAMETERS[PORT][row].removeprefix("port_") for row in motor.DEVIATIONS]
    nominal = physics.nominal_shaft(vehicle)
    changed = {
        name: getattr(nominal, name) * (1.0 + deviation)
        for name, deviation in zip(names, deviations, strict=False)
    }
    shaft = nominal._replace(**changed)
    shaft_speed = observations[0, INDEX["port_rpm"]] / RPM
    total = 0.0
    for k in range(1, N_SAMPLES):
        voltage = voltages.voltage[k, 0] + voltages.by_start[k, 0] * deviations[-1]
        side = physics.motor(shaft, constants, voltage)
        shaft_speed = physics.shaft_speed_after(shaft_speed, side, speeds[k], 0.0, SAMPLE_TIME)
        current = physics.armature_current(shaft, shaft_speed, voltage)
        for name, truth in zip(NAMES, (RPM * shaft_speed, current, voltage), strict=True):
            total += norm_logpdf(observations[k, INDEX[name]] - truth, CHANNELS[name].noise)
    return total


def norm_logpdf(error, std):
    return -0.5 * (error / std) ** 2 - math.log(std * math.sqrt(2.0 * math.pi))


def test_evidence_of_a_motor_is_that_by_integration_over_its_parameters(
    filtered, observations, voltages
):
    evidence, mean, covariance = filtered
    proposal = multivariate_normal(mean, 1.5 * covariance)
    draws = proposal.rvs(N_DRAWS, random_state=0)
    bands = [PARAMETERS[OWN_PARAMETERS[PORT][row]].band for row in motor.DEVIATIONS]
    inside = (np.abs(draws[:, :-1]) <= bands).all(axis=1)
    log_prior = -np.log(2.0 * np.array(bands)).sum()
    log_prior += norm.logpdf(draws[:, -1], scale=CHANNELS["port_voltage"].noise)
    log_weight = log_prior - proposal.logpdf(draws)
    paddle = PaddleWheel(CHANNELS["speed"].noise)
    speeds = [paddle.mean_speed(reading) for reading in observations[:, INDEX["speed"]]]
    for k in np.flatnonzero(inside):
        log_weight[k] += log_likelihood(draws[k], observations, speeds, voltages)
    exact = logsumexp(log_weight[inside]) - math.log(N_DRAWS)
    assert evidence == pytest.approx(exact, abs=2.0)


def test_filter_is_sure_of_the_vehicle_as_far_as_it_is_right(filtered):
    _, mean, covariance = filtered
    fleet = Fleet(1)
    fleet.reset([11], schedules=[()], missions=[MISSIONS["thesis"]])
    names = [OWN_PARAMETERS[PORT][row] for row in motor.DEVIATIONS]
    truth = fleet.plan.healthy[0][[list(PARAMETERS).index(name) for name in names]]
    nominal = GaussianBank().healthy[[list(PARAMETERS).index(name) for name in names]]
    error = truth / nominal - 1.0 - mean[:-1]
    misfit = error @ np.linalg.solve(covariance[:-1, :-1], error)
    assert misfit < 20.0
    bands = np.array([PARAMETERS[name].band for name in names])
    assert (np.sqrt(np.diag(covariance)[:-1]) < bands).all()


def test_paddle_wheel_follows_a_changing_speed():
    random = np.random.default_rng(0)
    time = SAMPLE_TIME * np.arange(400)
    speed = 0.4 + 0.08 * np.sin(0.2 * time)
    paddle = PaddleWheel(0.01)
    found = [paddle.mean_speed(u + 0.01 * random.standard_normal()) for u in speed]
    before = 0.4 + 0.08 * np.sin(0.2 * (time - 0.5 * SAMPLE_TIME))
    assert np.sqrt(np.square(found - before)[50:].mean()) < 0.005
