"""How much sooner faults are isolated under one stimulus than under another, on the same episodes.

Pure functions of isolation times by stimulus, (n_members, n_lanes) [s]. A stimulus has one member;
the agent has one for each seed of its training. A triple is a figure and the ends of its 95 %
interval.
"""

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from training.benchmark.scores import RANKED_AT
from training.metrics.intervals import central, resamples
from training.metrics.records import HORIZON
from training.stimuli.open_loop import Cruise, Thesis

# names of the agent's stimuli, one for each seed of its training
LEARNED = re.compile(r"learned(_\d+)?")
AGENT = "learned, all seeds"
REFERENCES = (Thesis.name, Cruise.name)
# the classes of each subset; empty stands for all classes
SUBSETS = {
    "all": (),
    # classes with hardly any difference at constant speed
    "confounded": (
        *("increased_drag", "decreased_drag", "sensor:speed"),
        *("propeller_damage:port", "propeller_damage:starboard"),
        *("propeller_loss:port", "propeller_loss:starboard"),
    ),
}
COSTS = ("speed_rms", "energy")

Triple = Sequence[float]
Figures = dict[str, Any]


def rules_from_belief(names: Iterable[str]) -> list[str]:
    """The stimuli that use the belief as the agent does, but by a fixed rule."""
    return [name for name in names if name.startswith("triggered_") or name == "greedy"]


def without_single_seeds(names: Iterable[str]) -> list[str]:
    """The names without the single seeds of the agent; all seeds together come first."""
    remaining = (name for name in names if not LEARNED.fullmatch(name))
    return sorted(remaining, key=lambda name: name != AGENT)


def with_agent(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Values (n_members, ...) by stimulus, with all seeds of the agent together as `AGENT`."""
    seeds = [values[name] for name in values if LEARNED.fullmatch(name)]
    agent = {AGENT: np.concatenate(seeds)} if seeds else {}
    return dict(values) | agent


def compare_by_subset(
    scores: Mapping[str, Any], diagnoser: str, fault: Sequence[str], seed: int
) -> dict[str, dict[str, Figures]]:
    """`paired_figures` for every one of `SUBSETS` and every class, by subset and stimulus.

    Parameters
    ----------
    scores
        Scores of a benchmark by stimulus and diagnoser.
    diagnoser
        The one whose isolation times are compared.
    fault
        True class of each lane, (n_lanes,).
    seed
        Seed of the bootstrap.
    """
    single_times = {
        name: np.array([by_diagnoser[diagnoser]["by_lane"]["isolation"]], float)
        for name, by_diagnoser in scores.items()
    }
    times = with_agent(single_times)
    fault = np.asarray(fault)
    subsets = SUBSETS | {str(name): (name,) for name in dict.fromkeys(fault.tolist())}
    figures = {}
    for name, classes in subsets.items():
        lanes = np.isin(fault, classes or fault)
        if lanes.any():
            subset_times = {stimulus: values[:, lanes] for stimulus, values in times.items()}
            figures[name] = paired_figures(subset_times, seed)
    return figures


def paired_figures(times: Mapping[str, np.ndarray], seed: int) -> dict[str, Figures]:
    """Figures of every stimulus on the same lanes.

    Misleads: a few training seeds remain a few after resampling; the intervals of the agent are
    rather too short.

    Returns
    -------
    figures
        By stimulus. mean: restricted mean of the isolation time [s], a triple. spread: standard
        deviation of the members' means [s], None for one member. isolated: share of lanes isolated
        before the horizon. difference, ratio: of the mean to that of `REFERENCES`, and for the
        agent to those of `rules_from_belief`, triples. Every resample has the same lanes for both
        stimuli; for the agent the members are resampled as well.
    """
    lanes = resamples(next(iter(times.values())).shape[1], seed)
    resampled = {name: resampled_means(values, lanes, seed) for name, values in times.items()}
    mean = {name: float(values.mean()) for name, values in times.items()}

    def compare(name: str, operation: Callable) -> dict[str, Triple]:
        others = [*REFERENCES, *(rules_from_belief(times) if name == AGENT else ())]
        triples = {}
        for other in filter(times.__contains__, others):
            interval = central(operation(resampled[name], resampled[other]))
            triples[other] = [operation(mean[name], mean[other]), *interval]
        return triples

    figures = {}
    for name, values in times.items():
        member_means = values.mean(axis=1)
        figures[name] = {
            "mean": [mean[name], *central(resampled[name])],
            "spread": float(member_means.std(ddof=1)) if len(values) > 1 else None,
            "isolated": float((values < HORIZON).mean()),
            "difference": compare(name, operator.sub),
            "ratio": compare(name, operator.truediv),
        }
    return figures


def speed_up(ratio: Triple) -> list[float]:
    """How many times sooner, from the ratio of the times; both are triples."""
    value, low, high = ratio
    return [1.0 / value, 1.0 / high, 1.0 / low]


def resampled_means(values: np.ndarray, lanes: np.ndarray, seed: int) -> np.ndarray:
    """Means (n,) of values (n_members, n_lanes) over resamples of lanes (n, n_lanes) and members.

    Members are resampled independently of lanes: the interval covers other vehicles and other
    trainings.
    """
    members = resamples(len(values), [seed, 1], len(lanes))
    return (members * (lanes @ values.T)).sum(axis=1) / values.size


def mean_costs(scores: Mapping[str, Any], diagnoser: str) -> dict[str, dict[str, float]]:
    """By stimulus: `COSTS` of the faulty episodes, and false alarms per hour on healthy ones."""
    single_costs = {
        name: np.array([_costs(by_diagnoser[diagnoser])]) for name, by_diagnoser in scores.items()
    }
    keys = *COSTS, "false_alarms_per_hour"
    return {
        name: dict(zip(keys, members.mean(axis=0).tolist(), strict=True))
        for name, members in with_agent(single_costs).items()
    }


def _costs(score: Mapping[str, Any]) -> list[float]:
    costs = [score["cost"][key] for key in COSTS]
    return [*costs, score["rates"][RANKED_AT]["false_alarms_per_hour"]]


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices, by cost, of the points (cost, delay) that no other point improves in both.

    >>> pareto_front([(1.0, 5.0), (2.0, 5.0), (3.0, 1.0), (2.0, 4.0)])
    [0, 3, 2]
    """
    front: list[int] = []
    for index in sorted(range(len(points)), key=points.__getitem__):
        if not front or points[index][1] < points[front[-1]][1]:
            front.append(index)
    return front
