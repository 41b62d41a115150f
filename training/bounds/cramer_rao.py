"""How well drag, thrust and the severity of their faults can be known at all: the posterior Cramer-Rao bound.

The recursion of Tichavsky, Muravchik & Nehorai (IEEE Trans. Signal Process. 46 (1998) 1386) is, for
a model that is linear around the true trajectory, the covariance of a Kalman filter linearised
there. So `SurgeFilter` is run with its mean replaced by the truth before every sample: its
covariance is the bound, and its equations stand nowhere twice.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from auv_fault_env.faults import fault_of
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PARAMETERS, SIDES
from auv_fault_env.truth import FleetTruth
from diagnosers.kalman import ParameterFilter, SurgeFilter

PRIOR = (0.3, 0.3, 0.5)  # relative standard deviations of alpha, beta, gamma: the filters' own
STILL = (0.0, 0.0, 0.0)  # the parameters do not walk
FAULTS = ("increased_drag", "decreased_drag", "propeller_damage:port", "propeller_loss:port")


def bound(kalman: SurgeFilter, truth: np.ndarray, observations: np.ndarray) -> np.ndarray:
    """Bound on the covariance of any estimate, (n_samples, n_lanes, n_states, n_states), parameters relative.

    A mean square error below it needs a bias, or knowledge that the prior does not hold. The surge
    model alone is meant: paddle wheel and shaft speeds; an estimate that also reads the
    accelerometer may be better.

    Parameters
    ----------
    kalman
        The model: noise, disturbance, and how uncertain the parameters are at the start.
    truth
        The states that were, (n_samples, n_lanes, n_states): speed, relative parameters,
        disturbance.
    observations
        (n_samples, n_lanes, n_channels).
    """
    estimate = kalman.initial(truth.shape[1])
    covariances = []
    for k, observation in enumerate(observations):
        estimate = kalman.update(estimate._replace(mean=truth[max(k - 1, 0)]), observation)
        covariances.append(estimate.covariance)
    return np.array(covariances)


def severity_std(fault: str, alpha_std: np.ndarray, beta_std: np.ndarray) -> np.ndarray:
    """Bound on the severity's standard deviation that follows from those of alpha or beta, whichever the fault changes.

    For faults of drag and thrust on a vehicle otherwise known; motor readings tell more of a
    propeller.
    """
    scale = fault_of(fault).scale
    if "alpha" in scale:
        return alpha_std / abs(scale["alpha"] - 1.0)
    return beta_std * len(SIDES) / sum(abs(scale.get(f"{side}_beta", 1.0) - 1.0) for side in SIDES)


def compare_filters_with_bound(seeds: Sequence[int], n_samples: int = 600) -> dict[str, Any]:
    """Root mean square errors [%] of both filters on the thesis' stimulus, the bound there and in cruise; severities.

    The vehicles' parameters are drawn from a third of the filters' prior, so that none is absurd,
    and the filters know that. The bounds on severities [1], at the end, are with the whole prior.
    """
    prior = tuple(std / 3.0 for std in PRIOR)
    runs = {
        mission: _vehicles(prior, seeds, n_samples, mission) for mission in ("cruise", "thesis")
    }
    errors = {
        "bound in cruise": _least(prior, *runs["cruise"]),
        "bound": _least(prior, *runs["thesis"]),
        "surge filter": _error(SurgeFilter(prior_std=prior, walk_std=STILL), *runs["thesis"]),
        "parameter filter": _error(
            ParameterFilter(prior_std=prior, walk_std=STILL), *runs["thesis"]
        ),
    }
    severity = {mission: _severities(_least(PRIOR, *run)[-1]) for mission, run in runs.items()}
    return {
        "errors": {
            name: {"alpha": _percent(of[:, 0]), "beta": _percent(of[:, 1])}
            for name, of in errors.items()
        },
        "severity": severity,
    }


def _least(
    prior: tuple[float, float, float], truth: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """Bound on the standard deviations of alpha and beta, root mean square over vehicles, (n_samples, 2)."""
    covariance = bound(SurgeFilter(prior_std=prior, walk_std=STILL), truth, observations)
    return np.sqrt(np.diagonal(covariance, axis1=2, axis2=3).mean(axis=1))[:, 1:3]


def _error(
    kalman: SurgeFilter | ParameterFilter, truth: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """Root mean square errors of alpha and beta over vehicles, (n_samples, 2)."""
    estimate = kalman.initial(truth.shape[1])
    means = []
    for observation in observations:
        estimate = kalman.update(estimate, observation)
        means.append(estimate.mean[:, 1:3])
    return np.sqrt(np.square(means - truth[:, :, 1:3]).mean(axis=1))


def _severities(std: np.ndarray) -> dict[str, float]:
    return {fault: float(severity_std(fault, *std)) for fault in FAULTS}


def _vehicles(
    prior: Sequence[float], seeds: Sequence[int], n_samples: int, mission: str
) -> tuple[np.ndarray, np.ndarray]:
    """True states (n_samples, n_lanes, 5) and observations of vehicles with parameters drawn from the prior."""
    n_lanes = len(seeds)
    names = list(PARAMETERS)
    relative = 1.0 + np.array(prior) * np.random.default_rng(list(seeds)).standard_normal(
        (n_lanes, 3)
    )
    fleet = Fleet(n_lanes, healthy_band=0.0)
    observation = fleet.reset(
        seeds, schedules=[()] * n_lanes, missions=[MISSIONS[mission]] * n_lanes
    )
    healthy = fleet.plan.healthy.copy()
    for column, rows in enumerate(
        (("alpha",), tuple(f"{side}_beta" for side in SIDES), ("gamma",))
    ):
        healthy[:, [names.index(row) for row in rows]] *= relative[:, column, None]
    fleet.set_healthy(healthy)
    truth = np.empty((n_samples, n_lanes, 5))
    observations = np.empty((n_samples, *observation.shape))
    for k in range(n_samples):
        state = FleetTruth(fleet)["state"]
        truth[k] = np.column_stack([state["speed"], relative, state["disturbance"]])
        observations[k] = observation
        observation = fleet.step(observation[:, :1] * [1.0, 0.0, 0.0])
    return truth, observations


def _percent(values: np.ndarray) -> list[float]:
    return np.round(100.0 * values, 4).tolist()
