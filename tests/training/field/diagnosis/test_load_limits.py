import numpy as np
import pytest

from training.field.diagnosis.load_limits import (
    LEAST_LIMIT,
    WINDOW,
    is_overloaded,
    load_limits,
    running_loads,
)

from ..fleet_logs import NAMES, VEHICLE, episode, log_of

HEALTHY = [log_of(episode(n_samples=400, seed=seed)) for seed in (21, 22, 23)]


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_more_and_less_load_exceed_the_limits_a_healthy_one_does_not(factor):
    limits = load_limits(HEALTHY, VEHICLE)
    observations = episode(n_samples=400, seed=24).copy()
    observations[:, NAMES.index("port_current")] *= factor
    beyond = is_overloaded(log_of(observations), VEHICLE, limits)
    assert beyond[WINDOW:].all() == (factor != 1.0) == beyond.any()
    assert all(low <= -LEAST_LIMIT < LEAST_LIMIT <= high for low, high in limits.values())


def test_a_load_needs_a_whole_window_of_its_own_segment():
    observations = np.concatenate([episode(n_samples=400, seed=21)] * 2)
    load = running_loads(log_of(observations, (slice(0, 400), slice(400, 800))), VEHICLE)["port"]
    assert np.isnan(load[: WINDOW - 1]).all() and np.isnan(load[400 : 400 + WINDOW - 1]).all()
    np.testing.assert_allclose(load[WINDOW:400], load[400 + WINDOW :])


def test_without_healthy_logs_there_is_no_limit():
    assert load_limits([], VEHICLE) == {}
    assert not is_overloaded(HEALTHY[0], VEHICLE, {}).any()
