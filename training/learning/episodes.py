"""Training episodes: half with the thesis' stimulus, half with random missions and manoeuvres."""

from collections.abc import Iterator

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import ScheduleSampler
from training.rollouts import Rollout, manoeuvres, roll_out
from training.seeds import seeds

N_SAMPLES = 600  # 60 s


def training_episodes(
    purpose: str,
    n_lanes: int,
    first: int = 0,
    schedules: ScheduleSampler | None = None,
) -> Iterator[Rollout]:
    """Two rollouts of 60 s, each of half of the lanes (an even number).

    The first has the thesis' speed changes, the second random missions and manoeuvres. The seeds
    are those of `training.seeds.seeds` from the first-th on.
    """
    chosen = seeds(purpose, n_lanes, first)
    half = n_lanes // 2
    thesis_seeds = chosen[:half]
    random_seeds = chosen[half:]
    fleet = Fleet(half, schedules=schedules)
    yield roll_out(fleet, thesis_seeds, N_SAMPLES, missions=[MISSIONS["thesis"]] * half)
    yield roll_out(fleet, random_seeds, N_SAMPLES, manoeuvres(random_seeds[0], N_SAMPLES, half))
