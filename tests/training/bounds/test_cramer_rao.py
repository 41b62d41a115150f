from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.parameters import PRESETS, SAMPLE_TIME
from diagnosers.kalman import SurgeFilter
from training.bounds import cramer_rao

RPM = 1500.0


def standing(n_samples: int, rpm: float) -> tuple[np.ndarray, np.ndarray]:
    """Truth and observations of a vehicle that stands still, its shafts turning."""
    truth = np.zeros((n_samples, 1, 5))
    observations = np.zeros((n_samples, 1, len(CHANNELS)))
    truth[:, :, 1:4] = 1.0
    for side in ("port", "starboard"):
        observations[:, :, INDEX[f"{side}_rpm"]] = rpm
    return truth, observations


def model() -> SurgeFilter:
    """All is known but the speed, and what the counters' noise does to it; hardly any drag."""
    vehicle = replace(PRESETS["thesis1992"], alpha=-1e-4, c2=0.0, disturbance_time=0.1)
    return SurgeFilter(vehicle, disturbance=0.0, prior_std=(1e-9,) * 3, walk_std=cramer_rao.NO_WALK)


def test_a_constant_speed_is_known_as_the_mean_of_its_readings():
    variance = cramer_rao.bound(model(), *standing(50, 0.0))[:, 0, 0, 0]
    samples = np.arange(1, 51)
    noise = CHANNELS["speed"].noise ** 2
    np.testing.assert_allclose(variance, 1.0 / (1.0 + samples / noise), rtol=1e-3)


def test_a_random_walk_settles_where_the_riccati_equation_says():
    """Scalar random walk of variance q a sample, read with variance r: p = (sqrt(q^2 + 4 q r) - q)
    / 2 in the end.
    """
    vehicle = PRESETS["thesis1992"]
    r = CHANNELS["speed"].noise ** 2
    q = 2.0 * (SAMPLE_TIME * vehicle.beta * RPM * CHANNELS["port_rpm"].noise) ** 2
    variance = cramer_rao.bound(model(), *standing(4000, RPM))[-1, 0, 0, 0]
    assert variance == pytest.approx((np.sqrt(q * q + 4.0 * q * r) - q) / 2.0, rel=0.02)


def test_the_filters_come_near_the_bound_and_do_not_beat_it():
    errors = cramer_rao.compare_filters_with_bound(range(60), n_samples=400)["errors"]
    for parameter in ("alpha", "beta"):
        bound, error = (
            np.array(errors[name][parameter])[100:] for name in ("bound", "surge filter")
        )
        assert (error > 0.75 * bound).all()
        assert error.mean() < 1.5 * bound.mean()
        assert bound[-1] < 0.8 * bound[0]


def test_severity_is_known_as_well_as_the_parameter_that_it_moves():
    assert cramer_rao.severity_std("increased_drag", 0.05, 9.0) == pytest.approx(0.05)
    assert cramer_rao.severity_std("decreased_drag", 0.05, 9.0) == pytest.approx(0.1)
    assert cramer_rao.severity_std("propeller_loss:port", 9.0, 0.05) == pytest.approx(0.1)
    assert cramer_rao.severity_std("propeller_damage:port", 9.0, 0.05) == pytest.approx(0.2)


def test_at_constant_speed_only_the_ratio_of_thrust_and_drag_is_known():
    """Of two numbers with the same prior, whose difference alone is known, each is known to prior /
    sqrt(2).
    """
    errors = cramer_rao.compare_filters_with_bound(range(8), n_samples=600)["errors"]
    for parameter in ("alpha", "beta"):
        cruise, thesis = (errors[name][parameter][-1] for name in ("bound in cruise", "bound"))
        assert 0.99 * 10.0 / np.sqrt(2.0) < cruise < 7.8
        assert thesis < cruise
