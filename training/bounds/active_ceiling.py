"""How much sooner a fault could be told from its rivals by a better stimulus: the active ceiling.

D* is the largest rate at which evidence against the most dangerous rival gathers, over speed
profiles that keep the budget (Chernoff, Ann. Math. Stat. 30 (1959) 755; Nitinawarat, Atia &
Veeravalli, IEEE Trans. Autom. Control 58 (2013) 2451). The largest possible speed-up of isolation
is D*/D, D being the rate of the passive run, or that under the thesis' stimulus.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from auv_fault_env.faults import classes, fault_of
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief
from training.bounds.delays import late_rate
from training.bounds.information import log_likelihoods_unknown_severity, simulate_lanes
from training.metrics.records import HORIZON
from training.seeds import seeds
from training.stimuli import BUDGET, Cruise, Stimulus, Thesis
from training.stimuli.base import within_channel

SEVERITY = 0.6
ONSET = 3.0
WINDOW = HORIZON / 2.0  # s, the time over which rates are measured
LIMITS = ((0.51, 15.49), (0.15, 0.85), (0.0, 1.0))  # of a profile
# of the search: so many profiles for each of the three fields
POPULATION = 4
GENERATIONS = 6
LEVELS = round(WINDOW)  # of a free profile, each held for a second
# of the search for these: changes in units of the budget, so many in every round
STEP = 0.5
TRIES = 11
ROUNDS = 8
# vehicles for each profile in the search, and for the best one
TRIED_ON = 4
JUDGED_ON = 24
FIRST_SEED = 700_000_000  # within those of tests
LEAST_RATE = 0.01  # nat/s: below it there is nothing to gain on
FAULTS = (
    *("increased_drag", "decreased_drag"),
    *(
        "propeller_damage:port",
        "propeller_loss:port",
        "seal_friction:port",
        "motor_overheating:port",
    ),
    *(
        f"sensor_bias:{channel}"
        for channel in ("speed", "acceleration", "port_voltage", "port_current", "port_rpm")
    ),
)


class Profile(NamedTuple):
    """A periodic speed offset: cycles in `WINDOW`, rounded, share of them above zero, how round, 0 square to 1 sine."""

    cycles: float
    duty: float
    roundness: float


def profile_offsets(profiles: np.ndarray, time: float, budget: float) -> np.ndarray:
    """Speed offsets [m/s], (n_profiles,), of profiles (n_profiles, 3) at a time [s].

    Over `WINDOW` their mean is zero and their root mean square the budget.
    """
    cycles, duty, roundness = np.asarray(profiles, float).T
    phase = (np.round(cycles) * time / WINDOW) % 1.0
    above = phase < duty
    level = np.where(above, np.sqrt((1.0 - duty) / duty), -np.sqrt(duty / (1.0 - duty)))
    within = np.where(above, phase / duty, (phase - duty) / (1.0 - duty))
    flat = 1.0 - roundness
    mean_square = flat * flat + flat * roundness * 4.0 / np.pi + roundness * roundness / 2.0
    return budget * level * (flat + roundness * np.sin(np.pi * within)) / np.sqrt(mean_square)


def scale_to_budget(profiles: np.ndarray, budget: float) -> np.ndarray:
    """Levels (n_profiles, LEVELS) shifted and scaled to a mean of zero and a root mean square of the budget."""
    centred = profiles - profiles.mean(axis=1, keepdims=True)
    return budget * centred / np.sqrt(np.mean(np.square(centred), axis=1, keepdims=True))


@dataclass(frozen=True, eq=False, kw_only=True)
class RepeatedOffsets(Stimulus):
    """For each lane speed offsets [m/s] sample by sample, (n_lanes, n_samples), over and over again."""

    name = "repeated"
    profiles: np.ndarray

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """That of each lane's profile, as far as the channel goes."""
        return within_channel(self.profiles[:, sample % self.profiles.shape[1]], observation)


def best_profile(rate: Callable[[np.ndarray], np.ndarray], seed: int) -> Profile:
    """The profile with the largest rate, found by differential evolution.

    Its rate in the search is too high where rates are random: judge it anew. A search this short
    misses narrow peaks.

    Parameters
    ----------
    rate
        Rates (n_profiles,) of profiles (n_profiles, 3).
    seed
        Of the search.
    """
    found = differential_evolution(
        lambda columns: -rate(columns.T),
        LIMITS,
        popsize=POPULATION,
        maxiter=GENERATIONS,
        rng=seed,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return Profile(round(found.x[0]), *map(float, found.x[1:]))


def best_free_levels(
    rate: Callable[[np.ndarray], np.ndarray], start: np.ndarray, seed: int
) -> np.ndarray:
    """Levels (LEVELS,) no worse than those to start from: in every round the best of random changes to the best so far.

    Parameters
    ----------
    rate
        Rates (n_profiles,) of levels (n_profiles, LEVELS), the same whenever they are asked for.
    start
        Levels (LEVELS,) of mean zero.
    seed
        Of the search.
    """
    random = np.random.default_rng(seed)
    best = start
    budget = np.sqrt(np.mean(np.square(start)))
    for _ in range(ROUNDS):
        changes = STEP * budget * random.standard_normal((TRIES, LEVELS))
        tried = scale_to_budget(np.vstack([best, best + changes]), budget)
        best = tried[rate(tried).argmax()]
    return best


def least_rates(fault: str, stimulus: Stimulus, lane_seeds: Sequence[int]) -> np.ndarray:
    """Rates [nat/s] against every class on average lanes, (n_lanes, n_classes); infinite for the fault's own."""
    n_lanes = len(lane_seeds)
    k = classes().index(fault_of(fault).diagnosis)
    event = FaultEvent(fault, ONSET, SEVERITY)
    mission = MISSIONS["cruise"]
    paths = log_likelihoods_unknown_severity(
        simulate_lanes(stimulus, [event] * n_lanes, [mission] * n_lanes, lane_seeds)
    )
    rates = late_rate(paths[:, :, k, None] - paths)
    rates[:, k] = np.inf
    return rates


def rates_of(
    fault: str, profiles: np.ndarray, lane_seeds: Sequence[int], budget: float = BUDGET
) -> np.ndarray:
    """Least rate over the rivals of each profile (n_profiles, 3), (n_profiles,), each on the same vehicles."""
    times = np.arange(round(WINDOW * SAMPLE_RATE)) * SAMPLE_TIME
    return _rates_of(fault, _table(profiles, times, budget), lane_seeds)


def free_rates_of(fault: str, free: np.ndarray, lane_seeds: Sequence[int]) -> np.ndarray:
    """The same of levels (n_profiles, LEVELS) [m/s]."""
    return _rates_of(fault, np.repeat(free, round(SAMPLE_RATE), axis=1), lane_seeds)


def _table(profiles: np.ndarray, times: np.ndarray, budget: float) -> np.ndarray:
    """Offsets (n_profiles, n_times) of profiles (n_profiles, 3)."""
    return np.stack([profile_offsets(profiles, time, budget) for time in times], axis=1)


def _rates_of(fault: str, tables: np.ndarray, lane_seeds: Sequence[int]) -> np.ndarray:
    stimulus = RepeatedOffsets(profiles=np.repeat(tables, len(lane_seeds), axis=0))
    rates = least_rates(fault, stimulus, list(lane_seeds) * len(tables))
    return rates.reshape(len(tables), len(lane_seeds), -1).mean(axis=1).min(axis=1)


def periodic_ceiling(fault: str, seed: int, budget: float = BUDGET) -> dict[str, Any]:
    """D* and D of a fault at `SEVERITY` around the cruise mission, the profile, and the speed-up.

    Both rates are those at which evidence gathers once the shock of the onset is over. D* is that
    of periodic profiles; see `free_ceiling` for more. No speed-up (None) is stated where the
    passive rate is nought: at constant speed drag and thrust look alike, and any ratio would be
    arbitrary.
    """
    tried, judged = _vehicles(seed)
    profile = best_profile(lambda profiles: rates_of(fault, profiles, tried, budget), seed)
    active = float(rates_of(fault, np.array([profile]), judged, budget)[0])
    against = least_rates(fault, Cruise(), judged).mean(axis=0)
    passive = float(against.min())
    return {
        "budget": budget,
        "profile": profile._asdict(),
        "active": active,
        "passive": passive,
        "passive_rival": classes()[int(against.argmin())],
        "speed_up": _speed_up(active, passive),
    }


def free_ceiling(fault: str, seed: int, budget: float) -> dict[str, Any]:
    """What `periodic_ceiling` says, and D* over free profiles too, each of `LEVELS` levels, beside D of the thesis' stimulus.

    best
        D*, that of the best profile of either kind [nat/s].
    free, levels
        Rate and levels [m/s] of the best free profile, sought from the best periodic one.
    thesis
        Rate under the thesis' stimulus at the same budget [nat/s].
    best_speed_up, thesis_speed_up
        D* relative to that in cruise, and to that under the thesis' stimulus; None where there is
        nothing to divide by.
    """
    found = periodic_ceiling(fault, seed, budget)
    (tried, judged) = _vehicles(seed)
    cycles, *shape = found["profile"].values()
    # quicker ones look constant, read once a second
    profile = np.array([[min(cycles, LEVELS // 2), *shape]])
    start = scale_to_budget(_table(profile, np.arange(LEVELS) + 0.5, budget), budget)[0]
    free = best_free_levels(lambda profiles: free_rates_of(fault, profiles, tried), start, seed)
    rate = float(free_rates_of(fault, free[None], judged)[0])
    thesis = float(least_rates(fault, Thesis(budget), judged).mean(axis=0).min())
    best = max(rate, found["active"])
    return found | {
        "free": rate,
        "levels": np.round(free, 4).tolist(),
        "best": best,
        "thesis": thesis,
        "best_speed_up": _speed_up(best, found["passive"]),
        "thesis_speed_up": _speed_up(best, thesis),
    }


def _vehicles(seed: int) -> tuple[range, range]:
    """Seeds of the vehicles that profiles are tried on, and of those that the best one is judged on."""
    tried = seeds("test", TRIED_ON, FIRST_SEED + seed)
    return tried, seeds("test", JUDGED_ON, FIRST_SEED + seed + TRIED_ON)


def _speed_up(active: float, passive: float) -> float | None:
    return active / passive if passive > LEAST_RATE else None
