import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from auv_fault_env.channels import INDEX, READINGS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import UNKNOWN, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.parameters import PARAMETERS, SIDES
from auv_fault_env.schedules import FaultEvent
from diagnosers.bank.algebra import covariance_row
from diagnosers.filter_bank import FilterBank, tails_of
from diagnosers.robust import algebra
from diagnosers.robust.algebra import N_MOMENTS, N_STATES, SEVERITY
from diagnosers.robust.hypotheses import OTHERS, WATER_CURRENT
from diagnosers.robust.sensors import spacing_of_values
from training.rollouts import roll_out
from training.seeds import seeds

CLASSES = list(classes())
LEGS = ((0.0, 0.3), (15.0, 0.5), (30.0, 0.25), (45.0, 0.4))
FIRST_SEED = 70_000


def log_probability(observations: np.ndarray, **settings) -> np.ndarray:
    """Of the filter bank, (n_samples, n_lanes, n_classes)."""
    bank = FilterBank(**settings)
    bank.reset(observations.shape[1])
    return np.stack([bank.update(observation).log_probability for observation in observations])


def observations_of(n_lanes, seconds, *events, **plant):
    fleet = Fleet(n_lanes, **plant)
    missions = [Mission(LEGS)] * n_lanes
    lanes = seeds("calibration", n_lanes, FIRST_SEED)
    rolled = roll_out(fleet, lanes, 10 * seconds, None, [events] * n_lanes, missions)
    return rolled.observations


def test_merging_two_filters_gives_the_moments_of_their_mixture():
    rng = np.random.default_rng(3)
    mean = rng.normal(size=(N_STATES, 2))
    roots = rng.normal(size=(2, N_STATES, N_STATES))
    covariance = roots @ np.swapaxes(roots, 1, 2)
    x = np.zeros((N_MOMENTS, 2))
    x[:N_STATES] = mean
    pairs = [(i, j) for i in range(N_STATES) for j in range(i + 1)]
    for i, j in pairs:
        x[covariance_row.py_func(i, j, N_STATES)] = covariance[:, i, j]
    algebra.merge.py_func(0, 1, 0.3, SimpleNamespace(filters=x))
    mixed = 0.3 * mean[:, 0] + 0.7 * mean[:, 1]
    distance = mean[:, 0] - mean[:, 1]
    spread = 0.21 * np.outer(distance, distance)
    expected = 0.3 * covariance[0] + 0.7 * covariance[1] + spread
    np.testing.assert_allclose(x[:SEVERITY, 1], mixed[:SEVERITY])
    for i, j in pairs:
        merged = expected if i < SEVERITY else covariance[1]
        assert x[covariance_row.py_func(i, j, N_STATES), 1] == pytest.approx(merged[i, j])


def test_gaussian_readings_prefer_no_other_variance_under_heavy_tails():
    tails = tails_of(6.0)

    def mean_log_density(std):
        def log_density(z):
            square = z * z / (tails.scale * std * std)
            return -math.log(std) - 0.5 * (tails.freedom + 1) * math.log1p(square / tails.freedom)

        return norm.expect(log_density)

    assert mean_log_density(1.0) > mean_log_density(0.9)
    assert mean_log_density(1.0) > mean_log_density(1.1)
    assert tails_of(1e4).scale == pytest.approx(1.0, abs=1e-3)


def test_the_step_of_a_converter_is_the_least_difference_of_its_readings():
    spacing = math.nan
    readings = [1.0, 1.0, 1.5, 1.25, 2.0, 1.25, 1.25]
    for before, now in pairwise(readings):
        spacing = spacing_of_values.py_func(spacing, now, before)
    assert spacing == 0.25


@pytest.mark.parametrize(
    "effect", ["resolution", "offsets", "tilt", "outliers", "water_current", "latency", "clipping"]
)
def test_an_imperfection_of_a_healthy_vehicle_is_no_fault(effect):
    observations = observations_of(6, 60, realism=1.0, imperfections=[effect])
    log_normal = log_probability(observations)[:, :, 0]
    assert (log_normal > -3.0).mean() > 0.98


def test_the_noise_of_the_sensors_is_estimated():
    """A factor of 2 on the noise is 4 on its variance; what the states take up is less of it."""
    ratio_of = {}
    for factor in (1.0, 2.0):
        observations = observations_of(8, 60, sensor_noise=factor)
        bank = FilterBank()
        bank.reset(8)
        log_normal = [bank.update(one).log_probability[:, 0] for one in observations]
        ratio_of[factor] = np.median(bank.running.state.noise_ratio, axis=0)
        assert (np.array(log_normal[100:]) > math.log(0.5)).mean() > 0.99
    assert (ratio_of[1.0] < 1.5).all()
    assert (ratio_of[2.0] > 2.3).all()
    assert (ratio_of[2.0] < 5.0).all()


def test_a_late_shaft_speed_is_compared_with_the_voltage_of_its_time():
    """At low speeds a misfit of the shaft's answer looks like a hot motor."""
    n_lanes = 8
    legs = [(20.0 * k, 0.12 + 0.1 * (k % 2)) for k in range(6)]
    fleet = Fleet(n_lanes, realism=1.0, imperfections=["latency"])
    missions = [Mission(legs)] * n_lanes
    lanes = seeds("calibration", n_lanes, FIRST_SEED)
    episodes = roll_out(fleet, lanes, 1200, None, [()] * n_lanes, missions)
    bank = FilterBank()
    bank.reset(n_lanes)
    log_normal = [bank.update(one).log_probability[:, 0] for one in episodes.observations]
    columns = [list(PARAMETERS).index(f"{side}_rpm_latency") for side in SIDES]
    true_latency = episodes.healthy[:, columns]
    assert 0.0 < true_latency.mean() < 1.0
    assert (bank.running.state.latency == true_latency).all()
    assert (np.array(log_normal) > math.log(0.5)).mean() > 0.99


def test_a_counter_that_is_later_than_any_healthy_one_is_unknown():
    legs = [(15.0 * k, 0.15 + 0.2 * (k % 2)) for k in range(5)]
    event = FaultEvent("late_counter:port", 20.0, 1.0)
    belief = log_probability(rolled(6, 60, legs, event))
    assert (belief[:200, :, 0] > math.log(0.5)).all()
    assert (belief[-1].argmax(axis=1) == CLASSES.index("unknown")).all()


def test_one_outlier_decides_nothing():
    observations = observations_of(2, 20)
    belief = log_probability(observations)
    for channel in READINGS:
        wrong = observations.copy()
        wrong[150, :, INDEX[channel]] *= 1.5
        assert (log_probability(wrong)[150, :, 0] > -10.0).all(), channel
    assert (belief[150, :, 0] > -1.0).all()


def test_a_command_that_steps_after_an_outlier_of_the_speed_is_no_fault():
    n_lanes = 64
    fleet = Fleet(n_lanes, realism=1.0, imperfections=("outliers",))
    lanes = seeds("calibration", n_lanes, FIRST_SEED)
    rolled = roll_out(fleet, lanes, 1500, None, [()] * n_lanes)
    normal = log_probability(rolled.observations)[:, :, 0]
    assert normal[600:].min() > math.log(0.15)


def test_a_repaired_seal_is_normal_again():
    event = FaultEvent("seal_friction:port", 10.0, 0.6, end=20.0)
    belief = log_probability(observations_of(4, 42, event))
    seal = CLASSES.index("seal_friction:port")
    assert (belief[190, :, seal] > math.log(0.5)).all()
    assert (belief[-1, :, 0] > math.log(0.5)).all()


def test_exact_zeros_at_rest_are_no_evidence():
    under_way = observations_of(2, 30)
    at_rest = np.zeros((600, *under_way.shape[1:]), np.float32)
    belief = log_probability(np.concatenate([at_rest, under_way, at_rest]))
    assert (belief[:, :, 0] > math.log(0.5)).mean() > 0.99
    assert (belief[-100:, :, 0] > math.log(0.5)).all()
    np.testing.assert_allclose(np.exp(belief).sum(axis=2), 1.0, rtol=1e-9)


@pytest.mark.parametrize("fault", ["weak_magnets:port", "worn_brushes:starboard"])
def test_a_fault_outside_the_catalogue_is_unknown_or_of_its_component(fault):
    belief = log_probability(observations_of(4, 30, FaultEvent(fault, 10.0, 1.0)))
    best = belief[-1].argmax(axis=1)
    right = {CLASSES.index(UNKNOWN)}
    side = fault.partition(":")[2]
    right.add(CLASSES.index(f"motor_overheating:{side}"))
    assert (belief[-1, :, 0] < math.log(0.15)).all()
    assert set(best.tolist()) <= right


def test_a_change_of_the_current_is_a_normal_vehicle():
    bank = FilterBank()
    table = bank.hypotheses()
    of_others = table.class_index[-len(OTHERS) :]
    expected = [0 if name == WATER_CURRENT else len(CLASSES) - 1 for name in OTHERS]
    assert of_others.tolist() == expected


def test_a_motor_whose_counter_is_not_logged_does_not_count_as_standing():
    """A reading that never arrived is no reading of zero."""
    fault = FaultEvent("motor_overheating:port", 10.0, 0.9)
    observations = observations_of(4, 40, fault)
    observations[:, :, [INDEX[f"{side}_rpm"] for side in ("port", "starboard")]] = np.nan
    belief = log_probability(observations)
    assert (belief[-1, :, 0] < math.log(0.05)).all()


def rolled(n_lanes, seconds, legs, *events, **plant):
    missions = [Mission(legs, legs[0][1])] * n_lanes
    lanes = seeds("calibration", n_lanes, FIRST_SEED)
    fleet = Fleet(n_lanes, **plant)
    return roll_out(fleet, lanes, 10 * seconds, None, [events] * n_lanes, missions).observations


@pytest.mark.parametrize("speed", [0.6, 0.85, 0.97])
def test_a_fast_healthy_vehicle_is_normal(speed):
    observations = rolled(8, 40, ((0.0, speed),), realism=1.0)
    log_normal = log_probability(observations)[:, :, 0]
    assert (log_normal > math.log(0.5)).mean() > 0.98


def test_a_start_from_rest_is_no_fault():
    observations = rolled(16, 40, ((0.0, 0.0), (10.0, 0.4)), realism=1.0)
    log_normal = log_probability(observations)[:, :, 0]
    assert (log_normal > -4.0).mean() > 0.98


def test_a_vehicle_at_rest_with_noisy_counters_is_normal():
    observations = rolled(8, 240, ((0.0, 0.0),))
    assert (log_probability(observations)[:, :, 0] > math.log(0.3)).all()


def test_a_counter_that_reads_zero_under_a_driving_voltage_is_found():
    observations = rolled(4, 40, ((0.0, 0.0), (10.0, 0.4)))
    observations[:, :, INDEX["port_rpm"]] = 0.0
    assert (log_probability(observations)[-1, :, 0] < math.log(0.1)).all()


def test_the_temperatures_are_roots_of_the_odds_of_a_fault_and_of_its_class():
    observations = observations_of(2, 20, FaultEvent("increased_drag", 5.0, 0.5))
    as_computed = log_probability(observations, temperature=1.0, class_temperature=1.0)
    tempered = log_probability(observations, temperature=2.0, class_temperature=3.0)

    def log_odds(belief):
        return np.logaddexp.reduce(belief[:, :, 1:], axis=-1) - belief[:, :, 0]

    np.testing.assert_allclose(log_odds(tempered), log_odds(as_computed) / 2.0, atol=1e-6)
    np.testing.assert_allclose(
        np.diff(tempered[:, :, 1:]), np.diff(as_computed[:, :, 1:]) / 3.0, atol=1e-9
    )
    np.testing.assert_allclose(np.exp(tempered).sum(axis=-1), 1.0)


def test_warming_and_gain_errors_of_sensors_widen_the_healthy_band_of_a_motor():
    std = np.sqrt(FilterBank().constants.healthy_variance[1])
    voltage_gain = 0.005 / math.sqrt(3.0)
    torque_constant = math.hypot(0.01 / math.sqrt(3.0), voltage_gain, 3.5 * 0.002)
    resistance = math.hypot(0.02 / math.sqrt(3.0), voltage_gain, voltage_gain, 3.5 * 0.0039)
    np.testing.assert_allclose(std[1:3], [torque_constant, resistance])


def test_without_voltages_a_healthy_vehicle_is_normal_and_friction_is_found():
    legs = ((0.0, 0.3), (10.0, 0.45), (20.0, 0.0), (30.0, 0.4))
    event = FaultEvent("seal_friction:port", 12.0, 0.8)
    voltages = [INDEX[f"{side}_voltage"] for side in ("port", "starboard")]
    beliefs = []
    for events in ((), (event,)):
        observations = rolled(8, 40, legs, *events)
        observations[:, :, voltages] = np.nan
        beliefs.append(log_probability(observations))
    healthy, faulty = beliefs
    assert (healthy[:, :, 0] > -5.0).all()
    assert (faulty[-1].argmax(axis=1) == CLASSES.index("seal_friction:port")).mean() > 0.8


def test_settings_are_checked():
    with pytest.raises(InputError, match="repair"):
        FilterBank(repair=0.9)
    with pytest.raises(InputError, match="memory"):
        FilterBank(memory=0.0)
    for name in ("temperature", "class_temperature"):
        with pytest.raises(InputError, match=name):
            FilterBank(**{name: 0.0})
