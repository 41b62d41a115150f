"""Episodes to train and to calibrate on: half with the thesis' stimulus, half with random missions and manoeuvres."""

from collections.abc import Iterator

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import ScheduleSampler
from training.rollouts import Rollout, manoeuvres, roll_out
from training.seeds import seeds

N_SAMPLES = 600  # 60 s


def training_episodes(
    purpose: str, n_lanes: int, first: int = 0, schedules: ScheduleSampler | None = None
) -> Iterator[Rollout]:
    """Two rollouts of half of n_lanes each, 60 s long: the thesis' speed changes, then random missions and manoeuvres.

    Band and noise are the fleet's defaults.

    Parameters
    ----------
    purpose, first
        Which seeds: `training.seeds.seeds` from the first-th on.
    n_lanes
        Lanes of both together, an even number.
    schedules
        Distribution of the faults; the fleet's own if not given.
    """
    chosen = seeds(purpose, n_lanes, first)
    half = n_lanes // 2
    fleet = Fleet(half, schedules=schedules)
    yield roll_out(fleet, chosen[:half], N_SAMPLES, missions=[MISSIONS["thesis"]] * half)
    yield roll_out(fleet, chosen[half:], N_SAMPLES, manoeuvres(chosen[half], N_SAMPLES, half))
