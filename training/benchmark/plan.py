"""The trials of a benchmark: every diagnoser under every stimulus on every part of the suite."""

import math
from collections.abc import Sequence
from itertools import chain, combinations, product
from typing import NamedTuple

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
MOST_HOURS = 1000.0  # of healthy operation, for which a block of seeds is enough


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
        missions = self.conditions(part).sample_missions(seeds)
        pairs = zip(seeds, missions, strict=True)
        return tuple(Episode(seed, (), mission) for seed, mission in pairs)

    def healthy_seeds(self, part: str, stimulus: Stimulus) -> range:
        """Seeds of the healthy lanes of a part under a stimulus."""
        first = self.suite.healthy[part] + SEED_BLOCK * stimulus.seed_block
        seconds = 3600.0 * self.hours[part] / len(self.stimuli)
        n_lanes = math.ceil(seconds / self.conditions(part).duration)
        return range(first, first + n_lanes)

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
            starts = range(0, len(lanes), LANES_PER_TRIAL)
            chunks = [lanes[start : start + LANES_PER_TRIAL] for start in starts]
            for entrant, chunk in product(entrants, chunks):
                trials.append(Trial(entrant, stimulus, part, conditions, chunk))
        return trials
