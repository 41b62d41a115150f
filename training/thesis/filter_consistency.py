"""Are the filters honest about their errors? NEES and NIS on the plant itself, against their chi-square bands.

The truth is drawn from the filters' own model: parameters start within the prior and walk at random
as the filter assumes, on the full plant with its motors, controllers and default noise. Then NEES
and NIS, averaged over independent seeds, are chi-square distributed; a filter that fools itself
leaves the band (Bar-Shalom, Li & Kirubarajan 2001, 5.4).
"""

from typing import Any

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PARAMETERS as PLANT_PARAMETERS
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.truth import FleetTruth
from diagnosers.consistency import band, nees, nis
from diagnosers.kalman import PARAMETERS, ParameterFilter, SurgeFilter

SETTLED = 50  # samples before the first test: the speed is known by then
PRIOR = (0.1, 0.1, 0.1)  # relative, so that no drawn vehicle is absurd
FILTERS = {"parameter filter": (ParameterFilter, 0.0), "surge filter": (SurgeFilter, 1.0)}
N_TRUE = {"parameter filter": 4, "surge filter": 5}  # leading states whose truth is compared
PLANT_ROWS = {"alpha": ("alpha",), "beta": ("port_beta", "starboard_beta"), "gamma": ("gamma",)}


class WalkingTruth:
    """Relative (alpha, beta, gamma) of every lane, (n_lanes, 3), walking at random below the filter's ceiling."""

    def __init__(self, kalman: ParameterFilter | SurgeFilter, n_lanes: int, seed: int):
        self.random = np.random.default_rng(seed)
        self.walk = np.array(kalman.constants.walk)
        self.ceiling = np.array(kalman.constants.ceiling)
        self.relative = 1.0 + np.sqrt(self.ceiling) * self.random.standard_normal((n_lanes, 3))

    def advance(self, variance: np.ndarray) -> None:
        """One sample of the filter's own random walk, given its variances of the parameters, (n_lanes, 3)."""
        step = self.walk * np.maximum(0.0, 1.0 - variance / self.ceiling)
        self.relative += np.sqrt(step) * self.random.standard_normal(self.relative.shape)

    def apply(self, fleet: Fleet) -> None:
        """Give the fleet these parameters from the next sample on."""
        names = list(PLANT_PARAMETERS)
        healthy = fleet.plan.healthy.copy()
        for column, name in enumerate(PARAMETERS):
            for row in PLANT_ROWS[name]:
                share = getattr(fleet.vehicle, name) / len(PLANT_ROWS[name])
                healthy[:, names.index(row)] = share * self.relative[:, column]
        fleet.set_healthy(healthy)


def run(
    name: str, seeds: int = 200, seed: int = 0, steps: int = 600
) -> tuple[np.ndarray, np.ndarray]:
    """NEES and NIS of one of `FILTERS`, (steps, seeds) each, on the thesis' stimulus with swinging rudders."""
    kind, disturbance = FILTERS[name]
    kalman = kind(disturbance=disturbance, prior_std=PRIOR)
    fleet = Fleet(seeds, disturbance=disturbance, healthy_band=0.0)
    observation = fleet.reset(
        range(seed, seed + seeds), schedules=[()] * seeds, missions=[MISSIONS["thesis"]] * seeds
    )
    truth = WalkingTruth(kalman, seeds, seed)
    estimate = kalman.update(kalman.initial(seeds), observation)
    errors = np.empty((steps, seeds))
    innovations = np.empty((steps, seeds))
    for k in range(steps):
        truth.advance(np.diagonal(estimate.covariance, axis1=1, axis2=2)[:, 1:4])
        truth.apply(fleet)
        swing = 0.2 * np.sin(0.05 * k)
        observation = fleet.step(np.column_stack([observation[:, 0], np.full((seeds, 2), swing)]))
        estimate = kalman.update(estimate, observation)
        errors[k] = nees(estimate, _state(fleet, truth)[:, : N_TRUE[name]])
        innovations[k] = nis(estimate)
    return errors, innovations


def _state(fleet: Fleet, truth: WalkingTruth) -> np.ndarray:
    state = FleetTruth(fleet)["state"]
    return np.column_stack([state["speed"], truth.relative, state["disturbance"]])


def summary(name: str, seeds: int, seed: int) -> dict[str, Any]:
    """NEES and NIS over time, their bands for one instant, means over time, and the share of instants inside.

    Neighbouring instants are correlated, so the share scatters about 95 % more widely than
    independent draws would.
    """
    result: dict[str, Any] = {"name": name, "seeds": seeds}
    for key, values, freedom in zip(
        ("NEES", "NIS"), run(name, seeds, seed), (N_TRUE[name], 1), strict=True
    ):
        series = values.mean(axis=1)
        (low, high) = band(freedom, seeds)
        settled = series[SETTLED:]
        inside = float(((settled >= low) & (settled <= high)).mean())
        result[key] = {
            "freedom": freedom,
            "low": low,
            "high": high,
            "mean": float(settled.mean()),
            "inside": inside,
        }
        result[key]["series"] = series.tolist()
    return result


def section(seeds: int, seed: int) -> dict[str, Any]:
    """The report's section: a table and a figure."""
    summaries = [summary(name, seeds, seed) for name in FILTERS]
    rows = [
        [
            one["name"],
            key,
            str(one[key]["freedom"]),
            f"{one[key]['mean']:.3f}",
            f"{one[key]['low']:.2f} to {one[key]['high']:.2f}",
            f"{100 * one[key]['inside']:.0f} %",
        ]
        for one in summaries
        for key in ("NEES", "NIS")
    ]
    time = (np.arange(1, 1 + len(summaries[0]["NEES"]["series"])) / SAMPLE_RATE).tolist()
    return {
        "heading": "Are the filters honest about their errors?",
        "text": [
            f"Normalised estimation error squared and normalised innovation squared, averaged over {seeds} seeds "
            f"(from {seed}), on the full plant with default noise (the surge filter also with the default "
            "disturbance), while the parameters walk at random as the filters assume. An honest filter stays "
            "inside its 95 % chi-square band at 95 % of the instants. Neighbouring instants are correlated, "
            "so the share for NEES scatters more widely about 95 % than independent draws would. Means and shares "
            "leave out the first five seconds."
        ],
        "table": {
            "columns": ["filter", "quantity", "expected", "mean", "95 % band", "instants inside"],
            "rows": rows,
        },
        "figures": [
            {
                "plot": "consistency",
                "name": "consistency",
                "caption": "NEES and NIS of both filters over time, with their 95 % bands.",
                "data": {"time": time, "summaries": summaries},
            }
        ],
    }
