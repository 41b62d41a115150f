"""Posterior Cramer-Rao bound: the best estimate of drag, thrust and the severity of their faults.

For a model that is linear around the true trajectory, the recursion of Tichavsky, Muravchik &
Nehorai (IEEE Trans. Signal Process. 46 (1998) 1386) is the covariance of a Kalman filter linearised
there. Therefore `SurgeFilter` runs with its mean replaced by the truth before every sample: its
covariance is the bound, and its equations stand in one place.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from auv_fault_env.faults import fault_of
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS, follow_mission
from auv_fault_env.parameters import PARAMETERS, SIDES
from auv_fault_env.truth import FleetTruth
from diagnosers.kalman import ParameterFilter, SurgeFilter

# relative standard deviations of alpha, beta and gamma in the prior of the filters
PRIOR = (0.3, 0.3, 0.5)
# the parameters are constant
NO_WALK = (0.0, 0.0, 0.0)
FAULTS = (
    "increased_drag",
    "decreased_drag",
    "propeller_damage:port",
    "propeller_loss:port",
)
# true states (n_samples, n_lanes, n_states) and observations (n_samples, n_lanes, n_channels)
Record = tuple[np.ndarray, np.ndarray]


def bound(kalman: SurgeFilter, truth: np.ndarray, observations: np.ndarray) -> np.ndarray:
    """Bound on the covariance of any estimate, (n_samples, n_lanes, n_states, n_states).

    Parameters are relative. A mean square error below the bound needs a bias, or knowledge that the
    prior does not contain. The bound holds for the surge model with paddle wheel and shaft speeds;
    an estimate that uses the accelerometer as well may be better.

    Parameters
    ----------
    kalman
        The model: noise, disturbance, and the prior of the parameters.
    truth
        True states (n_samples, n_lanes, n_states): speed, relative parameters, disturbance.
    observations
        (n_samples, n_lanes, n_channels).
    """
    estimate = kalman.initial(truth.shape[1])
    covariances = []
    for k, observation in enumerate(observations):
        around_truth = estimate._replace(mean=truth[max(k - 1, 0)])
        estimate = kalman.update(around_truth, observation)
        covariances.append(estimate.covariance)
    return np.array(covariances)


def severity_std(fault: str, alpha_std: np.ndarray, beta_std: np.ndarray) -> np.ndarray:
    """Bound on the std of the severity, from the std of the parameter that the fault changes.

    For faults of drag (alpha) and thrust (beta) on a vehicle that is known otherwise; readings of
    the motors say more about a propeller.
    """
    scale = fault_of(fault).scale
    if "alpha" in scale:
        return alpha_std / abs(scale["alpha"] - 1.0)
    change = sum(abs(scale.get(f"{side}_beta", 1.0) - 1.0) for side in SIDES)
    return beta_std * len(SIDES) / change


def compare_filters_with_bound(seeds: Sequence[int], n_samples: int = 600) -> dict[str, Any]:
    """Errors of both filters on the thesis' stimulus beside the bound, and bounds on severities.

    The parameters of the vehicles have a third of the standard deviation of the filters' prior, so
    that none is unphysical; the filters use the same. The bounds on severities use the whole prior.

    Returns
    -------
    comparison
        errors: root mean square error [%] of alpha and beta over time, by filter or bound;
        severity: bound on the standard deviation at the end, by mission and fault.
    """
    prior = tuple(std / 3.0 for std in PRIOR)
    cruise = _record(prior, seeds, n_samples, "cruise")
    thesis = _record(prior, seeds, n_samples, "thesis")
    surge_filter = SurgeFilter(prior_std=prior, walk_std=NO_WALK)
    parameter_filter = ParameterFilter(prior_std=prior, walk_std=NO_WALK)
    errors = {
        "bound in cruise": _least_std(prior, *cruise),
        "bound": _least_std(prior, *thesis),
        "surge filter": _error(surge_filter, *thesis),
        "parameter filter": _error(parameter_filter, *thesis),
    }
    return {
        "errors": {
            name: {"alpha": _percent(error[:, 0]), "beta": _percent(error[:, 1])}
            for name, error in errors.items()
        },
        "severity": {"cruise": _severities(cruise), "thesis": _severities(thesis)},
    }


def _least_std(
    prior: tuple[float, float, float], truth: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """Bound on the root mean square error of alpha and beta over vehicles, (n_samples, 2)."""
    covariance = bound(SurgeFilter(prior_std=prior, walk_std=NO_WALK), truth, observations)
    variances = np.diagonal(covariance, axis1=2, axis2=3)
    return np.sqrt(variances.mean(axis=1))[:, 1:3]


def _error(
    kalman: SurgeFilter | ParameterFilter, truth: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """Root mean square error of alpha and beta over vehicles, (n_samples, 2)."""
    estimate = kalman.initial(truth.shape[1])
    means = []
    for observation in observations:
        estimate = kalman.update(estimate, observation)
        means.append(estimate.mean[:, 1:3])
    errors = means - truth[:, :, 1:3]
    return np.sqrt(np.square(errors).mean(axis=1))


def _severities(record: Record) -> dict[str, float]:
    alpha_std, beta_std = _least_std(PRIOR, *record)[-1]
    return {fault: float(severity_std(fault, alpha_std, beta_std)) for fault in FAULTS}


def _record(prior: Sequence[float], seeds: Sequence[int], n_samples: int, mission: str) -> Record:
    """Simulate vehicles whose parameters follow the prior; states have 5 elements."""
    n_lanes = len(seeds)
    random = np.random.default_rng(list(seeds))
    relative = 1.0 + np.array(prior) * random.standard_normal((n_lanes, 3))
    fleet = Fleet(n_lanes, healthy_band=0.0)
    missions = [MISSIONS[mission]] * n_lanes
    observation = fleet.reset(seeds, schedules=[()] * n_lanes, missions=missions)
    fleet.set_healthy(_scaled(fleet.plan.healthy, relative))
    truth = np.empty((n_samples, n_lanes, 5))
    observations = np.empty((n_samples, *observation.shape))
    for k in range(n_samples):
        state = FleetTruth(fleet)["state"]
        truth[k] = np.column_stack([state["speed"], relative, state["disturbance"]])
        observations[k] = observation
        observation = fleet.step(follow_mission(observation))
    return truth, observations


def _scaled(healthy: np.ndarray, relative: np.ndarray) -> np.ndarray:
    """Parameters with alpha, both betas and gamma multiplied by `relative`, (n_lanes, 3)."""
    names = list(PARAMETERS)
    scaled = healthy.copy()
    groups = (("alpha",), tuple(f"{side}_beta" for side in SIDES), ("gamma",))
    for k, group in enumerate(groups):
        columns = [names.index(name) for name in group]
        scaled[:, columns] *= relative[:, k, None]
    return scaled


def _percent(values: np.ndarray) -> list[float]:
    return np.round(100.0 * values, 4).tolist()
