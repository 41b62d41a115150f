"""How much sooner a better stimulus could isolate a fault from its rivals: the active ceiling.

D* is the largest rate at which evidence against the most dangerous rival grows, over speed profiles
that keep the budget (Chernoff, Ann. Math. Stat. 30 (1959) 755; Nitinawarat, Atia & Veeravalli, IEEE
Trans. Autom. Control 58 (2013) 2451). The largest possible speed-up of isolation is D*/D; D is the
rate of the passive run, or that under the thesis' stimulus.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from auv_fault_env.faults import fault_of, known_classes
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief
from training.bounds.delays import late_rate
from training.bounds.information import (
    log_likelihoods_unknown_severity,
    simulate_lanes,
)
from training.metrics.records import HORIZON
from training.seeds import seeds
from training.stimuli import BUDGET, Cruise, Stimulus, Thesis
from training.stimuli.base import within_channel

SEVERITY = 0.6
# s
ONSET = 3.0
# s, the time over which rates are measured, and the times of its samples
WINDOW = HORIZON / 2.0
TIMES = np.arange(round(WINDOW * SAMPLE_RATE)) * SAMPLE_TIME
# range of each field of a profile
LIMITS = ((0.51, 15.49), (0.15, 0.85), (0.0, 1.0))
# search for a periodic profile: profiles per field of a profile, and generations
POPULATION = 4
GENERATIONS = 6
# levels of a free profile, of one second each
LEVELS = round(WINDOW)
# search for a free profile: changes relative to the budget, changes per round, and rounds
STEP = 0.5
TRIES = 11
ROUNDS = 8
# vehicles for each profile in the search, and for the best profile
TRIED_ON = 4
JUDGED_ON = 24
# within the seeds of tests
FIRST_SEED = 700_000_000
# nat/s; relative to a lower rate no speed-up is stated
LEAST_RATE = 0.01
FAULTS = (
    *("increased_drag", "decreased_drag"),
    *("propeller_damage:port", "propeller_loss:port"),
    *("seal_friction:port", "motor_overheating:port"),
    *("sensor_bias:speed", "sensor_bias:acceleration"),
    *("sensor_bias:port_voltage", "sensor_bias:port_current", "sensor_bias:port_rpm"),
)
# rates (n_profiles,) of profiles or levels (n_profiles, ...)
RateFunction = Callable[[np.ndarray], np.ndarray]


class Profile(NamedTuple):
    """A periodic speed offset.

    Attributes
    ----------
    cycles
        Number of cycles in `WINDOW`; rounded when used.
    duty
        Share of a cycle in which the offset is positive.
    roundness
        0 is a square wave, 1 a sine.
    """

    cycles: float
    duty: float
    roundness: float


def profile_offsets(profiles: np.ndarray, times: np.ndarray, budget: float) -> np.ndarray:
    """Speed offsets [m/s], (n_profiles, n_times), of profiles (n_profiles, 3) at times [s].

    Over `WINDOW` their mean is zero and their root mean square is the budget.
    """
    cycles, duty, roundness = np.asarray(profiles, float).T[..., None]
    phase = (np.round(cycles) * times / WINDOW) % 1.0
    is_positive = phase < duty
    positive_level = np.sqrt((1.0 - duty) / duty)
    negative_level = -np.sqrt(duty / (1.0 - duty))
    level = np.where(is_positive, positive_level, negative_level)
    phase_of_part = np.where(is_positive, phase / duty, (phase - duty) / (1.0 - duty))
    flat = 1.0 - roundness
    mean_square = flat * flat + flat * roundness * 4.0 / np.pi + roundness * roundness / 2.0
    shape = flat + roundness * np.sin(np.pi * phase_of_part)
    return budget * level * shape / np.sqrt(mean_square)


def level_offsets(levels: np.ndarray) -> np.ndarray:
    """The same, at `TIMES`, of levels (n_profiles, LEVELS) [m/s] of one second each."""
    return np.repeat(levels, round(SAMPLE_RATE), axis=1)


def scale_to_budget(levels: np.ndarray, budget: float) -> np.ndarray:
    """Levels (n_profiles, LEVELS) with mean zero and the budget as their root mean square."""
    centred = levels - levels.mean(axis=1, keepdims=True)
    mean_square = np.mean(np.square(centred), axis=1, keepdims=True)
    return budget * centred / np.sqrt(mean_square)


@dataclass(frozen=True, eq=False, kw_only=True)
class RepeatedOffsets(Stimulus):
    """The speed offsets [m/s] of a table (n_lanes, n_samples), sample by sample and repeated."""

    name = "repeated"
    profiles: np.ndarray

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """Offset of each lane at a sample, limited by the range of the speed command."""
        return within_channel(self.profiles[:, sample % self.profiles.shape[1]], observation)


def best_profile(rate: RateFunction, seed: int) -> Profile:
    """The profile with the largest rate, found by differential evolution.

    `rate` computes rates (n_profiles,) of profiles (n_profiles, 3). The rate of the best in the
    search is too high where rates are random: measure it again. A search as short as this one
    misses narrow peaks.
    """
    optimum = differential_evolution(
        lambda columns: -rate(columns.T),
        LIMITS,
        popsize=POPULATION,
        maxiter=GENERATIONS,
        rng=seed,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    cycles, duty, roundness = optimum.x
    return Profile(round(cycles), float(duty), float(roundness))


def best_free_levels(rate: RateFunction, start: np.ndarray, seed: int) -> np.ndarray:
    """Levels (LEVELS,) with a rate no lower than that of `start`, found by random changes.

    Every round changes the best levels so far at random and takes the best of the results. `rate`
    computes rates (n_profiles,) of levels (n_profiles, LEVELS), without randomness; `start` has
    mean zero.
    """
    random = np.random.default_rng(seed)
    best = start
    budget = np.sqrt(np.mean(np.square(start)))
    for _ in range(ROUNDS):
        changes = STEP * budget * random.standard_normal((TRIES, LEVELS))
        candidates = scale_to_budget(np.vstack([best, best + changes]), budget)
        best = candidates[rate(candidates).argmax()]
    return best


def least_rates(fault: str, stimulus: Stimulus, lane_seeds: Sequence[int]) -> np.ndarray:
    """Rates [nat/s] against every class, (n_lanes, n_known); infinite for the own class."""
    n_lanes = len(lane_seeds)
    k = known_classes().index(fault_of(fault).diagnosis)
    events = [FaultEvent(fault, ONSET, SEVERITY)] * n_lanes
    missions = [MISSIONS["cruise"]] * n_lanes
    lanes = simulate_lanes(stimulus, events, missions, lane_seeds)
    evidence = log_likelihoods_unknown_severity(lanes)
    rates = late_rate(evidence[:, :, k, None] - evidence)
    rates[:, k] = np.inf
    return rates


def rates_of(fault: str, offsets: np.ndarray, lane_seeds: Sequence[int]) -> np.ndarray:
    """Rates [nat/s] against the most dangerous rival under offsets (n_profiles, n_samples) [m/s].

    Every profile is tried on the same vehicles; the result is (n_profiles,).
    """
    n_profiles = len(offsets)
    n_vehicles = len(lane_seeds)
    stimulus = RepeatedOffsets(profiles=np.repeat(offsets, n_vehicles, axis=0))
    rates = least_rates(fault, stimulus, list(lane_seeds) * n_profiles)
    mean_rates = rates.reshape(n_profiles, n_vehicles, -1).mean(axis=1)
    return mean_rates.min(axis=1)


def periodic_ceiling(fault: str, seed: int, budget: float = BUDGET) -> dict[str, Any]:
    """D* over periodic profiles, and D, of a fault at `SEVERITY` around the cruise mission.

    Both are rates after the transient of the onset. `free_ceiling` searches more profiles. There is
    no speed-up (None) where the passive rate is zero: at constant speed drag and thrust cannot be
    distinguished, and any ratio would be arbitrary.

    Returns
    -------
    ceiling
        budget [m/s], profile, active (D*), passive (D) [nat/s], passive_rival, speed_up.
    """
    search_seeds, final_seeds = _vehicle_seeds(seed)

    def rate(profiles: np.ndarray) -> np.ndarray:
        return rates_of(fault, profile_offsets(profiles, TIMES, budget), search_seeds)

    profile = best_profile(rate, seed)
    best_offsets = profile_offsets(np.array([profile]), TIMES, budget)
    active = float(rates_of(fault, best_offsets, final_seeds)[0])
    passive_rates = least_rates(fault, Cruise(), final_seeds).mean(axis=0)
    passive = float(passive_rates.min())
    return {
        "budget": budget,
        "profile": profile._asdict(),
        "active": active,
        "passive": passive,
        "passive_rival": known_classes()[int(passive_rates.argmin())],
        "speed_up": _speed_up(active, passive),
    }


def free_ceiling(fault: str, seed: int, budget: float) -> dict[str, Any]:
    """D* over periodic and over free profiles, beside D in cruise and under the thesis' stimulus.

    Returns
    -------
    ceiling
        What `periodic_ceiling` returns, and: free, levels (rate [nat/s] and levels [m/s] of the
        best free profile, searched from the best periodic one); best (D*, the larger rate of both
        kinds); thesis (rate under the thesis' stimulus at the same budget); best_speed_up,
        thesis_speed_up (D* relative to the rates in cruise and under the thesis' stimulus, None
        where these are zero).
    """
    ceiling = periodic_ceiling(fault, seed, budget)
    search_seeds, final_seeds = _vehicle_seeds(seed)
    cycles, duty, roundness = ceiling["profile"].values()
    # with one level per second, faster profiles appear constant
    profile = np.array([[min(cycles, LEVELS // 2), duty, roundness]])
    sampled = profile_offsets(profile, np.arange(LEVELS) + 0.5, budget)
    start = scale_to_budget(sampled, budget)[0]

    def rate(levels: np.ndarray) -> np.ndarray:
        return rates_of(fault, level_offsets(levels), search_seeds)

    levels = best_free_levels(rate, start, seed)
    free = float(rates_of(fault, level_offsets(levels[None]), final_seeds)[0])
    thesis_rates = least_rates(fault, Thesis(budget), final_seeds).mean(axis=0)
    thesis = float(thesis_rates.min())
    best = max(free, ceiling["active"])
    return ceiling | {
        "free": free,
        "levels": np.round(levels, 4).tolist(),
        "best": best,
        "thesis": thesis,
        "best_speed_up": _speed_up(best, ceiling["passive"]),
        "thesis_speed_up": _speed_up(best, thesis),
    }


def _vehicle_seeds(seed: int) -> tuple[range, range]:
    """Seeds of the vehicles in the search, and of those on which the best profile is measured."""
    search_seeds = seeds("test", TRIED_ON, FIRST_SEED + seed)
    return search_seeds, seeds("test", JUDGED_ON, FIRST_SEED + seed + TRIED_ON)


def _speed_up(active: float, passive: float) -> float | None:
    return active / passive if passive > LEAST_RATE else None
