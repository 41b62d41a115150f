"""How much sooner a fault could be told from its rivals by a better stimulus: the active ceiling.

D* is the largest rate at which evidence against the most dangerous rival gathers, over speed profiles that keep the
budget (Chernoff, Ann. Math. Stat. 30 (1959) 755; Nitinawarat, Atia & Veeravalli, IEEE Trans. Autom. Control 58 (2013)
2451). The largest possible speed-up of isolation is D*/D, D being the rate of the passive run.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from auv_fault_env.faults import classes, fault_of
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief
from training.bounds import late_rate
from training.information import run, untold
from training.records import HORIZON
from training.seeds import seeds
from training.stimuli import BUDGET, Cruise, Stimulus

SEVERITY, ONSET = 0.6, 3.0
WINDOW = HORIZON / 2.0  # s, the time over which rates are measured
LIMITS = ((0.51, 15.49), (0.15, 0.85), (0.0, 1.0))  # of a profile
POPULATION, GENERATIONS = 4, 6  # of the search: so many profiles for each of the three fields
TRIED_ON, JUDGED_ON = 4, 24  # vehicles for each profile in the search, and for the best one
FIRST_SEED = 700_000_000  # within those of tests
LEAST_RATE = 0.01  # nat/s: below it there is nothing to gain on
FAULTS = (
    *("increased_drag", "decreased_drag"),
    *("propeller_damage:port", "propeller_loss:port", "seal_friction:port", "motor_overheating:port"),
    *(f"sensor_bias:{channel}" for channel in ("speed", "acceleration", "port_voltage", "port_current", "port_rpm")),
)


class Profile(NamedTuple):
    """A periodic speed offset: cycles in `WINDOW`, rounded, share of them above zero, how round, 0 square to 1 sine."""

    cycles: float
    duty: float
    roundness: float


def offsets(profiles: np.ndarray, time: float, budget: float) -> np.ndarray:
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


@dataclass(frozen=True)
class Periodic(Stimulus):
    """A profile for each lane, (n_lanes, 3), fields as in `Profile`."""

    name = "periodic"
    profiles: tuple[tuple[float, ...], ...] = ()

    def offset(self, sample: int, observation: np.ndarray, belief: Belief) -> np.ndarray:
        """That of each lane's profile."""
        return offsets(self.profiles, sample * SAMPLE_TIME, self.budget)


def best_profile(rate: Callable[[np.ndarray], np.ndarray], seed: int) -> Profile:
    """The profile with the largest rate, found by differential evolution.

    Its rate in the search is too high where rates are random: judge it anew. A search this short misses narrow peaks.

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


def least_rates(fault: str, stimulus: Stimulus, lane_seeds: Sequence[int]) -> np.ndarray:
    """Rates [nat/s] against every class on average lanes, (n_lanes, n_classes); infinite for the fault's own."""
    n_lanes, k = len(lane_seeds), classes().index(fault_of(fault).diagnosis)
    event, mission = FaultEvent(fault, ONSET, SEVERITY), MISSIONS["cruise"]
    paths = untold(run(stimulus, [event] * n_lanes, [mission] * n_lanes, lane_seeds))
    rates = late_rate(paths[:, :, k, None] - paths)
    rates[:, k] = np.inf
    return rates


def rates_of(fault: str, profiles: np.ndarray, lane_seeds: Sequence[int]) -> np.ndarray:
    """Least rate over the rivals of each profile, (n_profiles,), each on the same vehicles."""
    each, n = np.repeat(profiles, len(lane_seeds), axis=0), len(profiles)
    rates = least_rates(fault, Periodic(profiles=tuple(map(tuple, each))), list(lane_seeds) * n)
    return rates.reshape(n, len(lane_seeds), -1).mean(axis=1).min(axis=1)


def ceiling(fault: str, seed: int) -> dict[str, Any]:
    """D* and D of a fault at `SEVERITY` around the cruise mission, the profile, and the speed-up.

    Both rates are those at which evidence gathers once the shock of the onset is over. No speed-up (None) is stated
    where the passive rate is nought: at constant speed drag and thrust look alike, and any ratio would be
    arbitrary.
    """
    tried = seeds("test", TRIED_ON, FIRST_SEED + seed)
    judged = seeds("test", JUDGED_ON, FIRST_SEED + seed + TRIED_ON)
    profile = best_profile(lambda profiles: rates_of(fault, profiles, tried), seed)
    active = float(rates_of(fault, np.array([profile]), judged)[0])
    against = least_rates(fault, Cruise(), judged).mean(axis=0)
    passive = float(against.min())
    return {
        "budget": BUDGET,
        "profile": profile._asdict(),
        "active": active,
        "passive": passive,
        "passive_rival": classes()[int(against.argmin())],
        "speed_up": active / passive if passive > LEAST_RATE else None,
    }
