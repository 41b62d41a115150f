"""The Kalman filters against closed forms, a thesis run, their model's statistics, bad input."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest
from scipy import stats

from auv_fault_env.channels import CHANNELS
from auv_fault_env.parameters import FOOT, PRESETS, SAMPLE_TIME
from diagnosers.consistency import consistency_band, nees, nis
from diagnosers.kalman import (
    BETWEEN_STD,
    DISTURBANCE_FLOOR,
    START_SPEED_STD,
    ParameterFilter,
    SurgeFilter,
    opening_share,
)

VEHICLE = PRESETS["thesis1992"]
NOMINAL = np.array([VEHICLE.alpha, VEHICLE.beta, VEHICLE.gamma])
COLUMN = {name: index for index, name in enumerate(CHANNELS)}
FILTERS = pytest.mark.parametrize("kind", [ParameterFilter, SurgeFilter])


def surge_rate(speed, theta, thrust, deflection, disturbance):
    alpha, beta, gamma = (theta * NOMINAL).T
    square = speed * np.abs(speed)
    return alpha * square + beta * thrust + gamma * square * deflection + disturbance


def runge_kutta(rate, speed, substeps=10):
    """Integrate ``rate(speed, seconds)`` over one sample."""
    h = SAMPLE_TIME / substeps
    for k in range(substeps):
        t = k * h
        a = rate(speed, t)
        b = rate(speed + h / 2 * a, t + h / 2)
        c = rate(speed + h / 2 * b, t + h / 2)
        speed = speed + h / 6 * (a + 2 * b + 2 * c + rate(speed + h * c, t + h))
    return speed


def observe(speed=0.0, acceleration=0.0, rpm=0.0, rudder=0.0, noise=0.0, rng=None, n_lanes=1):
    observation = np.zeros((n_lanes, len(CHANNELS)))
    readings = dict(
        speed=speed, acceleration=acceleration, port_rpm=rpm, starboard_rpm=rpm, rudder=rudder
    )
    for name, value in readings.items():
        observation[:, COLUMN[name]] = value
        if noise:
            observation[:, COLUMN[name]] += (
                noise * CHANNELS[name].noise * rng.standard_normal(n_lanes)
            )
    return observation


def follow(kalman, observations):
    estimate = kalman.initial(observations.shape[1])
    for observation in observations:
        estimate = kalman.update(estimate, observation)
        yield estimate


def thesis_run(theta_after):
    """Noise-free observations (600, 1, n_channels), 0.5/1.0 ft/s for ten seconds each.

    The parameters change at 10 s.
    """
    tau = VEHICLE.inertia * VEHICLE.resistance / VEHICLE.torque_constant**2
    speed = np.array([0.5 * FOOT])
    rpm = 135.27
    observations = []
    for k in range(600):
        command = FOOT * (1.0 if (k // 100) % 2 else 0.5)
        theta = np.array([theta_after if k >= 100 else (1.0, 1.0, 1.0)])
        acceleration = 0.03 * (command - speed[0]) / 0.15
        thrust_input = (acceleration - VEHICLE.alpha * speed[0] ** 2) / VEHICLE.beta
        goal = max(0.0, thrust_input) ** 0.5

        def thrust(t, last=rpm, goal=goal):
            return (goal + (last - goal) * np.exp(-t / tau)) ** 2

        speed = runge_kutta(
            lambda u, t, theta=theta, thrust=thrust: surge_rate(u, theta, thrust(t), 0, 0), speed
        )
        rpm = goal + (rpm - goal) * exp(-SAMPLE_TIME / tau)
        observations.append(observe(speed, surge_rate(speed, theta, rpm * rpm, 0, 0), rpm))
    return np.array(observations)


@pytest.mark.parametrize(
    "change", [(1.35, 1.0, 1.0), (1.0, 0.65, 1.0)], ids=["alpha+35%", "beta-35%"]
)
@FILTERS
def test_thesis_run_is_identified_as_in_figures_4_1_and_4_2(kind, change):
    kalman = kind(VEHICLE, sensor_noise=0.01, disturbance=0.0)
    which = [kalman.states.index(name) for name in ("alpha", "beta")]
    means = np.array([estimate.mean[0, which] for estimate in follow(kalman, thesis_run(change))])
    error = means / change[:2] - 1
    settled = 300 if kind is ParameterFilter else 400
    assert np.abs(means[:99] - 1).max() < 0.001
    assert np.abs(error[settled:]).max() < 0.02
    assert np.abs(error[-1, 0]) < 0.003
    assert np.abs(error[-1, 1]) < 0.002


def forget_speed(estimate):
    """The same estimate with the speed unknown, so that it contains no accelerometer error."""
    covariance = estimate.covariance.copy()
    covariance[:, 0, :] = covariance[:, :, 0] = 0.0
    covariance[:, 0, 0] = 1e6
    return estimate._replace(covariance=covariance)


def test_parameter_filter_without_walk_is_regularised_least_squares():
    """With the speed known and no random walk: batch least squares with the prior as a penalty."""
    rng = np.random.default_rng(1)
    kalman = ParameterFilter(VEHICLE, disturbance=0.0, walk_std=(0.0, 0.0, 0.0))
    vars(kalman)["constants"] = kalman.constants._replace(speed_variance=1e-20, rpm_variance=0.0)
    estimate = kalman.initial(1)
    precision = np.diag(1 / np.array(kalman.prior_std) ** 2)
    moment = precision @ np.ones(3)
    rho = exp(-SAMPLE_TIME / VEHICLE.disturbance_time)
    noise = CHANNELS["acceleration"].noise ** 2 + DISTURBANCE_FLOOR**2 * (1 + rho) / (1 - rho)
    for _ in range(200):
        speed = rng.uniform(0.1, 1)
        rpm = rng.uniform(100, 900)
        rudder = rng.uniform(-0.4, 0.4)
        acceleration = rng.normal(0, 0.05)
        estimate = kalman.update(forget_speed(estimate), observe(speed, acceleration, rpm, rudder))
        row = NOMINAL * [speed**2, rpm**2, speed**2 * rudder**2]
        precision += np.outer(row, row) / noise
        moment += row * acceleration / noise
    np.testing.assert_allclose(
        estimate.covariance[0, 1:4, 1:4], np.linalg.inv(precision), rtol=1e-6
    )
    np.testing.assert_allclose(estimate.mean[0, 1:4], np.linalg.solve(precision, moment), rtol=1e-6)


def test_innovation_variance_of_the_acceleration_counts_every_input_noise():
    """One update from known, uncorrelated uncertainties, against the first-order sum by hand."""
    kalman = ParameterFilter(VEHICLE, sensor_noise=10.0, disturbance=0.0, walk_std=(0.0, 0.0, 0.0))
    u = 1.5
    rpm = 400.0
    rudder = 0.4
    start = kalman.initial(1)._replace(mean=np.array([[u, 1.0, 1.0, 1.0, 0.0]]))
    after = kalman.update(start, observe(u, 0.0, rpm, rudder))
    by_speed = 2 * u * (VEHICLE.alpha + VEHICLE.gamma * rudder**2)
    by_rpm = 2 * VEHICLE.beta * rpm / 2 * np.array([1.0, 1.0])
    by_theta = NOMINAL * [u * u, rpm * rpm, u * u * rudder**2] * kalman.prior_std
    share = 0.1**2 / (START_SPEED_STD**2 + 0.1**2)  # of the predicted speed in the corrected one
    of_speed = by_speed**2 * share * START_SPEED_STD**2
    of_error = (1 - by_speed * share * SAMPLE_TIME * (1 - kalman.constants.opening)) ** 2 * 0.02**2
    expected = (by_theta**2).sum() + of_speed + of_error + (by_rpm**2).sum() * 10.0**2
    assert after.innovation_variance[0] == pytest.approx(expected, rel=1e-5)
    assert of_speed > 0.1 * expected


def test_surge_filter_at_rest_has_the_likelihood_of_a_linear_gaussian_model():
    """At u = 0 and n = 0 d drives the speed in a random walk: the readings are jointly normal."""
    readings = 1e-6 * np.random.default_rng(3).standard_normal(30)
    kalman = SurgeFilter(VEHICLE)
    estimates = follow(kalman, np.array([observe(z) for z in readings]))
    total = sum(estimate.log_likelihood[0] for estimate in estimates)
    steps = np.arange(len(readings))
    drive = VEHICLE.disturbance_std**2 * exp(-SAMPLE_TIME / VEHICLE.disturbance_time) ** np.abs(
        steps - steps[:, None]
    )
    sums = SAMPLE_TIME * np.tri(len(readings))
    covariance = (
        sums @ drive @ sums.T
        + START_SPEED_STD**2
        + CHANNELS["speed"].noise ** 2 * np.eye(len(readings))
    )
    assert total == pytest.approx(
        stats.multivariate_normal(cov=covariance).logpdf(readings), abs=1e-4
    )


def test_speed_stage_removes_the_attenuation_of_a_squared_paddle_wheel():
    rng = np.random.default_rng(2)
    n_lanes = 2000
    speed = 0.1
    rpm = (VEHICLE.alpha / -VEHICLE.beta) ** 0.5 * speed
    kalman = ParameterFilter(
        VEHICLE, disturbance=0.0, walk_std=(0.0, 0.0, 0.0), prior_std=(10.0, 1e-6, 1e-6)
    )
    observations = np.array([observe(speed, 0.0, rpm, 0.0, 1.0, rng, n_lanes) for _ in range(600)])
    *_, last = follow(kalman, observations)
    square = VEHICLE.alpha * observations[..., COLUMN["speed"]] ** 2
    drag = observations[..., COLUMN["acceleration"]] - VEHICLE.beta * rpm**2
    least_squares = (square * drag).sum() / (square**2).sum()
    assert least_squares == pytest.approx(0.95, abs=0.01)
    assert last.mean[:, 1].mean() == pytest.approx(1.0, abs=0.015)


# leading states of which the model run has the truth
TRUE_STATES = {ParameterFilter: 4, SurgeFilter: 5}


def model_run(kalman, n_lanes, n_steps, seed):
    """Yield (estimate, truth); the truth follows the filter's own model, random walk included."""
    rng = np.random.default_rng(seed)
    c = kalman.constants
    normal = lambda *shape: rng.standard_normal((n_lanes, *shape))  # noqa: E731
    theta = 1 + normal(3) * kalman.prior_std
    disturbed = ("disturbance" in kalman.states) * c.disturbance_variance**0.5
    speed = 0.3 + 0.02 * normal()
    disturbance = disturbed * normal()
    rpm = 0.0
    estimate = kalman.initial(n_lanes)
    for k in range(n_steps):
        diagonal = np.einsum("lii->li", estimate.covariance)[:, 1:4]
        theta = theta + normal(3) * np.sqrt(c.walk * np.maximum(0, 1 - diagonal / c.ceiling))
        rho = c.disturbance_memory
        disturbance = rho * disturbance + disturbed * (1 - rho**2) ** 0.5 * normal()
        last = rpm
        rpm = (550.0, 150.0)[k // 50 % 2]
        rudder = (0.0, 0.4, 0.2)[k // 35 % 3]
        thrust = (
            c.opening * last**2
            + (1 - c.opening) * rpm**2
            + BETWEEN_STD * (rpm**2 - last**2) * normal()
        )
        state = (theta, thrust, rudder**2, disturbance)
        speed = runge_kutta(lambda u, _, state=state: surge_rate(u, *state), speed, 2)
        acceleration = surge_rate(speed, theta, rpm**2, rudder**2, disturbance)
        estimate = kalman.update(
            estimate, observe(speed, acceleration, rpm, rudder, 1.0, rng, n_lanes)
        )
        yield estimate, np.column_stack([speed, theta, disturbance])[:, : TRUE_STATES[type(kalman)]]


@pytest.mark.parametrize(
    "kalman", [ParameterFilter(disturbance=0.0), SurgeFilter()], ids=lambda k: type(k).__name__
)
def test_errors_and_innovations_are_as_large_as_the_filter_says(kalman):
    n_lanes = 200
    times = (50, 150, 300, 450)
    run = list(model_run(kalman, n_lanes, times[-1], seed=0))
    # 95 % for all instants together
    low, high = consistency_band(TRUE_STATES[type(kalman)], n_lanes, 1 - 0.05 / len(times))
    for time in times:
        assert low < nees(*run[time - 1]).mean() < high
    innovations = np.array([nis(estimate) for estimate, _ in run[50:]])
    low, high = consistency_band(1, innovations.size)
    assert low < innovations.mean() < high


def hostile(n_lanes, n_steps, seed=4):
    """Yield observations: silent, saturated, random over full scale, at rest, noise-free."""
    rng = np.random.default_rng(seed)
    low, high = np.array([(channel.low, channel.high) for channel in CHANNELS.values()]).T
    cruise = observe(0.3, 0.0, 270.0, n_lanes=n_lanes)
    least = np.tile(low, (n_lanes, 1))
    full = np.tile(high, (n_lanes, 1))
    empty = 0 * cruise
    for k in range(n_steps):
        phase = k // 50 % 7
        if phase == 1:
            yield rng.uniform(low, high, cruise.shape)
        elif phase == 2:
            yield cruise * (rng.random(cruise.shape) < 0.7)
        else:
            yield {3: empty, 4: full, 5: least}.get(phase, cruise)


@pytest.mark.parametrize("scale", [0.0, 1.0], ids=["noise-nil", "noise-default"])
@FILTERS
def test_covariance_stays_symmetric_positive_definite_and_bounded(kind, scale):
    kalman = kind(VEHICLE, sensor_noise=scale, disturbance=scale)
    estimate = kalman.initial(2)
    ceiling = 1.001 * np.array(kalman.prior_std) ** 2
    for k, observation in enumerate(hostile(2, 100_000)):
        estimate = kalman.update(estimate, observation)
        if k % 13 == 0:
            assert np.array_equal(estimate.covariance, estimate.covariance.swapaxes(1, 2))
            assert np.linalg.eigvalsh(estimate.covariance).min() > 0
            assert (np.einsum("lii->li", estimate.covariance)[:, 1:4] <= ceiling).all()
            assert np.isfinite(estimate.mean).all() and np.isfinite(estimate.log_likelihood).all()


@FILTERS
def test_a_minute_of_good_readings_undoes_hostile_ones(kind):
    kalman = kind(VEHICLE, disturbance=0.0)
    n_lanes = 50
    *_, estimate = follow(kalman, np.array(list(hostile(n_lanes, 350))))
    assert np.abs(estimate.mean[:, 1:3] - 1).max() > 0.5
    for observation in thesis_run((1.0, 1.0, 1.0)):
        estimate = kalman.update(estimate, np.repeat(observation, n_lanes, axis=0))
    assert np.abs(estimate.mean[:, 1:3] - 1).max() < 0.1


@FILTERS
def test_a_batch_of_lanes_is_its_lanes_bit_for_bit(kind):
    kalman = kind(VEHICLE)
    rng = np.random.default_rng(5)
    observations = np.array([observe(0.3, 0.0, 270.0, 0.1, 1.0, rng, 7) for _ in range(50)])
    *_, together = follow(kalman, observations)
    for lane in range(7):
        *_, alone = follow(kalman, observations[:, lane : lane + 1])
        for whole, part in zip(together, alone, strict=True):
            assert np.array_equal(whole[lane : lane + 1], part)


@FILTERS
def test_update_leaves_its_arguments_alone(kind):
    kalman = kind(VEHICLE)
    before = kalman.initial(3)
    kalman.update(before, observe(0.3, 0.0, 270.0, n_lanes=3))
    for array, fresh in zip(before, kalman.initial(3), strict=True):
        assert np.array_equal(array, fresh)


@FILTERS
def test_unobservable_parameters_stay_at_their_prior(kind):
    """At rest, with shafts and planes still, nothing is learnt and nothing grows."""
    kalman = kind(VEHICLE)
    *_, estimate = follow(kalman, np.zeros((2000, 1, len(CHANNELS))))
    assert np.sqrt(np.diag(estimate.covariance[0])[1:4]) == pytest.approx(
        kalman.prior_std, rel=1e-9
    )
    assert estimate.mean[0, 1:4] == pytest.approx(1.0)


@FILTERS
def test_physical_estimate_is_in_units_of_the_vehicle(kind):
    kalman = kind(replace(VEHICLE, alpha=-0.2))
    mean, covariance = kalman.physical(kalman.initial(1))
    alpha = kalman.states.index("alpha")
    assert mean[0, alpha] == -0.2
    assert covariance[0, alpha, alpha] == pytest.approx((0.3 * 0.2) ** 2)
    assert mean[0, kalman.states.index("beta")] == VEHICLE.beta


def test_opening_share_runs_from_an_instant_motor_to_the_trapezoid():
    assert opening_share(VEHICLE) == pytest.approx(0.19, abs=0.01)
    assert opening_share(replace(VEHICLE, inertia=1e-6)) < 0.01
    assert opening_share(replace(VEHICLE, inertia=0.3)) == pytest.approx(0.5, abs=1e-3)


@FILTERS
def test_refusals_name_the_thing_and_what_is_allowed(kind):
    kalman = kind(VEHICLE)
    with pytest.raises(ValueError, match=r"observation's shape: got \(12,\); allowed is \(2, 12\)"):
        kalman.update(kalman.initial(2), np.zeros(12))
    with pytest.raises(ValueError, match="sensor_noise: got -1"):
        kind(VEHICLE, sensor_noise=-1)
    with pytest.raises(ValueError, match=r"prior_std of alpha: got 0.0"):
        kind(VEHICLE, prior_std=(0.0, 0.3, 0.5))
