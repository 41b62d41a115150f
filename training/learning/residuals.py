"""Fits the relations of `residuals` to simulated healthy vehicles, all of the healthy band."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MissionSampler
from auv_fault_env.parameters import SAMPLE_RATE, SIDES
from diagnosers.relations.episode import EpisodeWindows
from diagnosers.relations.model import RelationModel, Scatter, residuals_of
from diagnosers.relations.windows import Layout, Typical, n_terms
from diagnosers.residuals import Residuals, lasting
from training.learning.episodes import course_with_rests
from training.learning.relation_fit import (
    all_windows,
    fit_relation,
    model_with,
    typical_of,
    with_shares,
)
from training.rollouts import roll_out
from training.seeds import SPAN, seeds

LAYOUT = Layout(SIDES, has_shaft_speed=True, sample_rate=SAMPLE_RATE)
LANES = 128  # missions that are simulated together
SETS = 4  # of missions for scatter and limits
DURATION = 600.0  # s, of a mission
LEGS = MissionSampler(duration=(8.0, 300.0), n_legs=12)
WITHIN = 0.98  # share of the healthy missions that stay within a limit


class ResidualsTrainer:
    """Weighted least squares on all missions at once: one epoch.

    The relations are those of an average vehicle, from which each vehicle of the band differs.
    Scatter and limits are from missions of their own: a share `WITHIN` of them stays within each
    limit for as long as an alarm takes.
    """

    epochs = 1
    patience = 1
    data = (
        f"fitted to {LANES} healthy missions of {DURATION:g} s with rests and manoeuvres, realism "
        f"1, default band and noise; validated on as many, scatter and limits of {SETS * LANES}"
    )

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.first = np.array([random.integers(SPAN - LANES)])
        self.typical = np.zeros((len(SIDES), len(Typical._fields)))
        self.coefficients = {name: np.zeros(n) for name, n in n_terms(LAYOUT).items()}

    def epoch(self, number: int) -> dict[str, float]:
        """Fit the relations."""
        missions = list(healthy_missions("training", int(self.first[0])))
        self.typical = np.array([typical_of(missions, side) for side in SIDES])
        parts = all_windows(missions, LAYOUT, self._typical)
        self.coefficients = {name: fit_relation(name, parts, LAYOUT) for name in LAYOUT.relations}
        return {"loss": relative_error(self.coefficients, parts)}

    @property
    def _typical(self) -> dict[str, Typical]:
        return {side: Typical(*row) for side, row in zip(SIDES, self.typical.tolist(), strict=True)}

    def validate(self) -> dict[str, float]:
        """The same loss on the validation seeds."""
        parts = all_windows(healthy_missions("validation"), LAYOUT, self._typical)
        return {"loss": relative_error(self.coefficients, parts)}

    def state(self) -> dict[str, np.ndarray]:
        """The first seed, and what the fit has found."""
        return {"first": self.first, "typical": self.typical, **self.coefficients}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over a result of `state`."""
        self.first = state["first"]
        self.typical = state["typical"]
        self.coefficients = {name: state[name] for name in LAYOUT.relations}

    def finish(self) -> tuple[Residuals, dict[str, Any]]:
        """The diagnoser, and the smallest lasting changes that it finds, by residual."""
        parts = all_windows(calibration_missions(), LAYOUT, self._typical)
        model = model_with(self.coefficients, parts, LAYOUT, self._typical)
        model = with_limits(with_shares(model, parts), calibration_missions())
        smallest = model.smallest_changes()
        return Residuals(model), {f"smallest_change_{name}": smallest[name] for name in smallest}


def calibration_missions() -> Iterator[np.ndarray]:
    """The missions for scatter and limits."""
    return chain.from_iterable(healthy_missions("calibration", k * LANES) for k in range(SETS))


def healthy_missions(purpose: str, first: int = 0) -> Iterator[np.ndarray]:
    """Readings (n_samples, n_channels) of healthy vehicles of the band, with realism."""
    lanes = seeds(purpose, LANES, first)
    n_samples = round(DURATION * SAMPLE_RATE)
    course = course_with_rests(lanes, n_samples=n_samples, sampler=LEGS)
    fleet = Fleet(LANES, realism=1.0)
    healthy = [()] * LANES
    rollout = roll_out(fleet, lanes, n_samples, course.actions, healthy, course.missions)
    for lane in range(LANES):
        yield rollout.observations[:, lane].astype(np.float64)


def relative_error(
    coefficients: Mapping[str, np.ndarray], parts: Sequence[EpisodeWindows]
) -> float:
    """Root mean square of the residuals by the median of what is predicted, mean over them."""
    pairs = [residuals_of(LAYOUT, coefficients, part.windows) for part in parts]
    residual, size = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return float(np.mean(np.sqrt(np.mean(residual**2, axis=0)) / np.median(size, axis=0)))


def with_limits(model: RelationModel, missions: Iterable[np.ndarray]) -> RelationModel:
    """The model with limits of residuals that a share `WITHIN` of the missions stays within.

    Within means not beyond it for as long as an alarm takes. Missions are (n_samples, n_channels).
    """
    diagnoser = Residuals(model)
    strengths = [diagnoser.course(one).strength.max(axis=0, initial=0.0) for one in missions]
    of_rules = np.quantile(strengths, WITHIN, axis=0)
    factor = dict(zip(diagnoser.rules, of_rules.tolist(), strict=True))

    def scaled(limits: Mapping[str, Scatter]) -> dict[str, Scatter]:
        return {name: one._replace(limit=factor[name] * one.limit) for name, one in limits.items()}

    return replace(
        model,
        steady=scaled(model.steady),
        changing=scaled(model.changing),
        lasting={name: factor[lasting(name)] * limit for name, limit in model.lasting.items()},
    )
