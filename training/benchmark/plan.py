"""The trials of a benchmark: every diagnoser under every stimulus on every part of the suite."""

from collections.abc import Sequence
from itertools import chain, combinations, product
from typing import NamedTuple

import numpy as np

from auv_fault_env.errors import refusal
from training.benchmark.suites import Conditions, Episode, Suite
from training.benchmark.trials import (
    COUNTING,
    FAULTY,
    LANES_PER_TRIAL,
    PARTS,
    THRESHOLD,
    Entrant,
    Trial,
)
from training.stimuli import Stimulus

SEED_BLOCK = 100_000  # seeds of healthy lanes that each stimulus has for itself
# samples of all lanes of a trial, which it holds in memory: 9 bytes each, and copies
MOST_SAMPLES = 4_000_000
FEWEST_LANES = 16  # of a trial that could have more: below, a sample costs mostly the call
# the longest lane of a trial by its shortest, once it has `FEWEST_LANES`
LARGEST_RATIO = 1.3


class BenchmarkPlan(NamedTuple):
    """What is to be run."""

    suite: Suite
    threshold_conditions: Conditions  # what thresholds are set under, whatever the suite
    stimuli: Sequence[Stimulus]  # each on the same faulty episodes
    hours: dict[str, float]  # healthy operation by part, shared by the stimuli [h]
    every: int = 1  # k: each k-th faulty episode is run

    @property
    def faulty_episodes(self) -> tuple[Episode, ...]:
        """The faulty episodes that are run."""
        return self.suite.episodes[:: self.every]

    def episodes(self, part: str, stimulus: Stimulus) -> tuple[Episode, ...]:
        """The lanes of a part under a stimulus."""
        if part == FAULTY:
            return self.faulty_episodes
        seeds = self.healthy_seeds(part, stimulus)
        return tuple(self.conditions(part).healthy_episodes(seeds))

    def healthy_seeds(self, part: str, stimulus: Stimulus) -> range:
        """Seeds of the healthy lanes of a part under a stimulus."""
        first = self.suite.healthy[part] + SEED_BLOCK * stimulus.seed_block
        seconds = 3600.0 * self.hours[part] / len(self.stimuli)
        return enough_lanes(self.conditions(part), first, seconds)

    def check_seeds(self) -> None:
        """Refuse a suite in which a vehicle serves twice, say for a threshold and for a score."""
        seeds_by_part = {FAULTY: {episode.seed for episode in self.suite.episodes}}
        for part in (THRESHOLD, COUNTING):
            ranges = [self.healthy_seeds(part, stimulus) for stimulus in self.stimuli]
            seeds_by_part[part] = set(chain.from_iterable(ranges))
        for first, second in combinations(seeds_by_part, 2):
            shared = seeds_by_part[first] & seeds_by_part[second]
            if shared:
                thing = f"suite {self.suite.name}, seed of a {first} and of a {second} lane"
                remedy = "move one of them and seal the file"
                raise refusal(thing, min(shared), "vehicles that serve once", remedy)

    def conditions(self, part: str) -> Conditions:
        """What the vehicles of a part run under."""
        return self.threshold_conditions if part == THRESHOLD else self.suite.conditions

    def trials(self, entrants: Sequence[Entrant]) -> list[Trial]:
        """All trials of these diagnosers by part, stimulus and diagnoser, in the order of lanes."""
        trials = []
        for part, stimulus in product(PARTS, self.stimuli):
            conditions = self.conditions(part)
            lanes = self.episodes(part, stimulus)
            for entrant, chunk in product(entrants, chunks(conditions, lanes)):
                trials.append(Trial(entrant, stimulus, part, conditions, chunk))
        return trials


def enough_lanes(conditions: Conditions, first: int, seconds: float) -> range:
    """Seeds from `first` on of as many healthy lanes as last so long together."""
    n_lanes = 1
    while (total := np.cumsum(conditions.durations(range(first, first + n_lanes))))[-1] < seconds:
        n_lanes *= 2
    return range(first, first + int(np.searchsorted(total, seconds - 1e-6)) + 1)


def chunks(conditions: Conditions, lanes: Sequence[Episode]) -> list[tuple[Episode, ...]]:
    """The lanes of each trial: lanes of about the same duration, so that few wait for others."""
    lengths = conditions.lengths(lanes)
    ascending = np.argsort(lengths, kind="stable")
    found: list[list[int]] = [[]]
    for lane in ascending:
        if _is_full(lengths[found[-1]], lengths[lane]):
            found.append([])
        found[-1].append(lane)
    return [tuple(lanes[lane] for lane in chunk) for chunk in found if chunk]


def _is_full(lengths: np.ndarray, longest: int) -> bool:
    """Whether a trial of lanes of these lengths has no room for a longer one."""
    n_together = lengths.size + 1
    if n_together > LANES_PER_TRIAL or n_together * longest > MOST_SAMPLES:
        return True
    return lengths.size >= FEWEST_LANES and longest > LARGEST_RATIO * lengths[0]
