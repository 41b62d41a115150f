"""Which trials a benchmark consists of: every diagnoser, under every stimulus, on every part of the suite."""

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
MOST_HOURS = 1000.0  # of healthy operation, for which the seeds between two stimuli are enough


class BenchmarkPlan(NamedTuple):
    """What is to be run.

    Attributes
    ----------
    suite
        Its faulty episodes, its conditions, its seeds of healthy lanes.
    standard
        Conditions that the thresholds are set under, whatever the suite.
    stimuli
        Stimuli to run, each on the same faulty episodes.
    hours
        Healthy operation by part, each shared by the stimuli [h].
    every
        Each so many-th faulty episode is run.
    """

    suite: Suite
    standard: Conditions
    stimuli: Sequence[Stimulus]
    hours: dict[str, float]
    every: int = 1

    def episodes(self, part: str, stimulus: Stimulus) -> tuple[Episode, ...]:
        """The lanes of a part under a stimulus."""
        if part == FAULTY:
            return self.suite.episodes[:: self.every]
        seeds = self.seeds(part, stimulus)
        missions = self.conditions(part).draw_missions(seeds)
        return tuple(
            Episode(seed, (), mission) for seed, mission in zip(seeds, missions, strict=True)
        )

    def seeds(self, part: str, stimulus: Stimulus) -> range:
        """Seeds of the healthy lanes of a part under a stimulus."""
        first = self.suite.healthy[part] + SEED_BLOCK * stimulus.seed_block
        seconds = 3600.0 * self.hours[part] / len(self.stimuli)
        return range(first, first + math.ceil(seconds / self.conditions(part).duration))

    def check_seeds(self) -> None:
        """Refuse a suite in which a vehicle serves two purposes: nothing is scored on what a threshold is set on."""
        taken: dict[str, set[int]] = {FAULTY: {episode.seed for episode in self.suite.episodes}}
        for part in (THRESHOLD, COUNTING):
            taken[part] = set(
                chain.from_iterable(self.seeds(part, stimulus) for stimulus in self.stimuli)
            )
        for one, other in combinations(taken, 2):
            if both := taken[one] & taken[other]:
                thing = f"suite {self.suite.name}, seed of a {one} and of a {other} lane"
                raise refusal(
                    thing,
                    min(both),
                    "vehicles that serve once",
                    "move one of them and seal the file",
                )

    def conditions(self, part: str) -> Conditions:
        """What the vehicles of a part run under."""
        return self.standard if part == THRESHOLD else self.suite.conditions

    def trials(self, entrants: Sequence[Entrant]) -> list[Trial]:
        """All trials of these diagnosers; those of a part and a stimulus follow one another, in the order of lanes."""
        found = []
        for part, stimulus in product(PARTS, self.stimuli):
            conditions = self.conditions(part)
            lanes = self.episodes(part, stimulus)
            chunks = [
                lanes[first : first + LANES_PER_TRIAL]
                for first in range(0, len(lanes), LANES_PER_TRIAL)
            ]
            found += [
                Trial(entrant, stimulus, part, conditions, chunk)
                for entrant, chunk in product(entrants, chunks)
            ]
        return found
