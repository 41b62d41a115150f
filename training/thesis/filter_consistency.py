"""Consistency of the filters: NEES and NIS on the plant, against their chi-square bands.

The truth follows the filters' own model: parameters start within the prior and walk at random as
the filter assumes, on the full plant with its motors, controllers and default noise. Then NEES and
NIS, averaged over independent seeds, are chi-square distributed; a filter that is wrong about its
errors leaves the band (Bar-Shalom, Li & Kirubarajan 2001, 5.4).
"""

from typing import Any

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PARAMETERS as PLANT_PARAMETERS
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.truth import FleetTruth
from diagnosers.consistency import consistency_band, nees, nis
from diagnosers.kalman import PARAMETERS, ParameterFilter, SurgeFilter
from training.report.sections import figure, table_section

SETTLED = 50  # samples before the first test: the speed is known by then
PRIOR = (0.1, 0.1, 0.1)  # relative, so that no vehicle is absurd
# class and disturbance
FILTERS = {
    "parameter filter": (ParameterFilter, 0.0),
    "surge filter": (SurgeFilter, 1.0),
}
N_TRUE = {
    "parameter filter": 4,
    "surge filter": 5,
}  # leading states whose truth is compared
PLANT_ROWS = {
    "alpha": ("alpha",),
    "beta": ("port_beta", "starboard_beta"),
    "gamma": ("gamma",),
}


class WalkingTruth:
    """Relative (alpha, beta, gamma) of every lane, which walk at random below the filter's ceiling.

    `relative` are the parameters now, (n_lanes, 3).
    """

    def __init__(self, kalman: ParameterFilter | SurgeFilter, n_lanes: int, seed: int):
        self.random = np.random.default_rng(seed)
        self.walk = np.array(kalman.constants.walk)
        self.ceiling = np.array(kalman.constants.ceiling)
        self.relative = 1.0 + np.sqrt(self.ceiling) * self.random.standard_normal((n_lanes, 3))

    def advance(self, variance: np.ndarray) -> None:
        """One sample of the filter's random walk, from its variances (n_lanes, 3)."""
        step = self.walk * np.maximum(0.0, 1.0 - variance / self.ceiling)
        self.relative += np.sqrt(step) * self.random.standard_normal(self.relative.shape)

    def apply(self, fleet: Fleet) -> None:
        """Set these parameters of the fleet from the next sample on."""
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
    """NEES and NIS (steps, seeds) of one of `FILTERS` on the thesis' mission with swinging rudders.

    `seeds` is the number of seeds, `seed` the first of them.
    """
    make_filter, disturbance = FILTERS[name]
    kalman = make_filter(disturbance=disturbance, prior_std=PRIOR)
    fleet = Fleet(seeds, disturbance=disturbance, healthy_band=0.0)
    observation = fleet.reset(
        range(seed, seed + seeds),
        schedules=[()] * seeds,
        missions=[MISSIONS["thesis"]] * seeds,
    )
    truth = WalkingTruth(kalman, seeds, seed)
    estimate = kalman.update(kalman.initial(seeds), observation)
    errors = np.empty((steps, seeds))
    innovations = np.empty((steps, seeds))
    for k in range(steps):
        variance = np.diagonal(estimate.covariance, axis1=1, axis2=2)
        truth.advance(variance[:, 1:4])
        truth.apply(fleet)
        rudders = np.full((seeds, 2), 0.2 * np.sin(0.05 * k))
        observation = fleet.step(np.column_stack([observation[:, 0], rudders]))
        estimate = kalman.update(estimate, observation)
        errors[k] = nees(estimate, _true_state(fleet, truth)[:, : N_TRUE[name]])
        innovations[k] = nis(estimate)
    return errors, innovations


def _true_state(fleet: Fleet, truth: WalkingTruth) -> np.ndarray:
    state = FleetTruth(fleet)["state"]
    return np.column_stack([state["speed"], truth.relative, state["disturbance"]])


def summary(name: str, seeds: int, seed: int) -> dict[str, Any]:
    """NEES and NIS over time, their bands at one instant, means, and the share of time inside.

    Neighbouring instants are correlated, so the share scatters about 95 % more widely than
    independent ones would.
    """
    errors, innovations = run(name, seeds, seed)
    nees_summary = _summarise(errors, N_TRUE[name])
    nis_summary = _summarise(innovations, 1)
    return {"name": name, "seeds": seeds, "NEES": nees_summary, "NIS": nis_summary}


def _summarise(statistic: np.ndarray, freedom: int) -> dict[str, Any]:
    """Summary of a statistic (steps, seeds) with so many degrees of freedom."""
    series = statistic.mean(axis=1)
    low, high = consistency_band(freedom, statistic.shape[1])
    settled = series[SETTLED:]
    is_inside = (settled >= low) & (settled <= high)
    return {
        "freedom": freedom,
        "low": low,
        "high": high,
        "mean": float(settled.mean()),
        "inside": float(is_inside.mean()),
        "series": series.tolist(),
    }


def section(seeds: int, seed: int) -> dict[str, Any]:
    """Section of the report with a table and a figure."""
    summaries = [summary(name, seeds, seed) for name in FILTERS]
    rows = []
    for result in summaries:
        for key in ("NEES", "NIS"):
            rows.append(_row(result["name"], key, result[key]))
    n_samples = len(summaries[0]["NEES"]["series"])
    time = (np.arange(1, 1 + n_samples) / SAMPLE_RATE).tolist()
    text = (
        "Normalised estimation error squared (NEES) and normalised innovation squared (NIS), "
        f"averaged over {seeds} seeds (from {seed}), on the full plant with default noise (the "
        "surge filter also with the default disturbance), while the parameters walk at random as "
        "the filters assume. A filter with the right covariance stays inside the 95 % chi-square "
        "band at 95 % of the instants. Neighbouring instants are correlated, so the share for NEES "
        "scatters more widely about 95 % than independent ones would. Means and shares leave out "
        "the first five seconds."
    )
    caption = "NEES and NIS of both filters over time, with their 95 % bands."
    data = {"time": time, "summaries": summaries}
    figures = [figure("consistency", "consistency", caption, data)]
    columns = [
        "filter",
        "quantity",
        "expected",
        "mean",
        "95 % band",
        "instants inside",
    ]
    heading = "Do the filters know their own errors?"
    return table_section(heading, columns, rows, text) | {"figures": figures}


def _row(name: str, key: str, statistic: dict[str, Any]) -> list[str]:
    limits = f"{statistic['low']:.2f} to {statistic['high']:.2f}"
    inside = f"{100 * statistic['inside']:.0f} %"
    return [
        name,
        key,
        str(statistic["freedom"]),
        f"{statistic['mean']:.3f}",
        limits,
        inside,
    ]
