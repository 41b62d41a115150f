"""A suite of validation seeds, to compare diagnosers while they are developed.

The conditions are those of the suite `standard`. Every lane has one permanent fault, every class
equally likely, severity 0.2 to 1, onset 5 to 30 s, abrupt or ramped.
"""

from dataclasses import replace

from training.benchmark import suites
from training.benchmark.suites import HEALTHY_PARTS, ONE_FAULT, Episode, Suite
from training.seeds import seeds

NAME = "validation"
# the first validation seeds belong to the trainers
FIRST_SEED = {
    "faulty": 100_000_000,
    "threshold": 200_000_000,
    "counting": 300_000_000,
}


def validation_suite(n_lanes: int, offset: int) -> Suite:
    """The suite with so many faulty lanes, at an offset within the seeds of validation."""
    conditions = suites.load(suites.STANDARD).conditions
    faulty_seeds = seeds("validation", n_lanes, FIRST_SEED["faulty"] + offset)
    missions = conditions.sample_missions(faulty_seeds)
    healthy = {part: seeds("validation", 1, FIRST_SEED[part] + offset)[0] for part in HEALTHY_PARTS}
    episodes = [
        Episode(seed, ONE_FAULT.sample(seed), mission)
        for seed, mission in zip(faulty_seeds, missions, strict=True)
    ]
    suite = Suite(
        name=NAME,
        about="every class equally likely on validation seeds, conditions of the suite standard",
        conditions=conditions,
        healthy=healthy,
        episodes=tuple(episodes),
        purpose="validation",
    )
    return replace(suite, hash=suite.content_hash)
