"""Stimuli at equal cost on healthy vehicles: ``python -m training.studies.stimulus_front``.

Every stimulus runs over a range of strengths on the same vehicles of a suite, with `filter_bank` in
the loop: faulty ones for isolation, healthy ones for cost and false alarms, and others for the
thresholds, which each point has for itself, because a stimulus changes the rate of false alarms. In
the results a triple is a figure and the ends of its 95 % interval::

    suite            name, hash
    classes, lanes   the classes of the faulty vehicles; vehicles by part
    hours            of healthy operation for the thresholds [h]
    seed             of the study
    points           a list: stimulus, strength [m/s], members (trainings of an agent), healthy and
                     faulty (`stimulus_front_scores.cost`), fronts (by cost, whether no other point
                     improves it in both), and rates (by mean time between false alarms)
      rates          threshold, is_extrapolated, detection [s], isolated (share), false_alarms,
                     isolation and of_known_onset (`compared` with `REFERENCE` and `KNOWN_ONSET`)
    equal_cost       {stimulus: {healthy cost [m/s]: `compared` with `REFERENCE`, or None}}
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from tyro.conf import arg

from auv_fault_env.errors import finite_in_range, refusal, whole_number
from training.benchmark import suites
from training.benchmark.suites import IDEAL
from training.benchmark.trials import FAULTY, lane_truth
from training.known_names import SUITES
from training.stimuli.base import BUDGET
from training.stimuli.known_onset import FasterFromOnset
from training.stimuli.open_loop import Cruise, Thesis
from training.studies.run import command_line, run_study
from training.studies.stimulus_comparisons import AGENT, LEARNED, SUBSETS, pareto_front
from training.studies.stimulus_front_page import page
from training.studies.stimulus_front_runs import (
    FrontLanes,
    FrontRuns,
    Point,
    lanes_of,
    point_of,
    read_runs,
)
from training.studies.stimulus_front_scores import RATES, at_costs, compared, point_scores

# the stimulus without an offset, the one of the thesis at its strength, and one that knows the
# onset: all others are compared with these
PASSIVE = Point(Cruise.name, 0.0)
REFERENCE = Point(Thesis.name, BUDGET)
KNOWN_ONSET = Point(FasterFromOnset.name, 0.1)
RANKED_AT = next(iter(RATES))
# costs of the fronts, on healthy vehicles
COSTS = ("rms", "energy")
EQUAL_COSTS = (0.025, 0.05, BUDGET, 0.1)  # m/s
STRENGTHS = {
    **dict.fromkeys(("thesis", "constant", "multisine", "d_optimal"), (0.025, 0.05, BUDGET, 0.1)),
    **dict.fromkeys(("triggered_d_optimal", "triggered_surge"), (0.05, 0.1, 0.2)),
    **dict.fromkeys(("standing_surge", "two_experiments"), (0.05, 0.1, 0.15, 0.2)),
    "learned": (0.05, 0.1, 0.2, 0.4),
    "known_onset": (0.05, 0.1, 0.25),
}
MAIN_POINTS = tuple(
    Point(name, strength).label for name, strengths in STRENGTHS.items() for strength in strengths
)
LARGEST_SEED = 1000


@dataclass(frozen=True)
class StimulusFront:
    """Compare stimuli at equal cost on healthy vehicles, and draw the front."""

    points: Annotated[tuple[str, ...], arg(metavar="STIMULUS:BUDGET")] = MAIN_POINTS
    """Stimuli with their budgets [m/s]; those that all are compared with are always among them."""
    suite: str = IDEAL
    """Suite that gives vehicles and conditions."""
    per_class: int = 32
    """Faulty vehicles of each class of hull, propellers and paddle wheel."""
    healthy: int = 80
    """Healthy vehicles for cost and false alarms."""
    hours: float = 10.0
    """Healthy operation for the thresholds of each point [h]."""
    workers: int = 2
    """Number of processes; the results do not depend on it."""
    seed: int = 0
    """Which vehicles of the suite; also the seed of the bootstrap intervals."""
    output: Path = Path("runs/stimulus_front")
    """Folder of the report; an earlier run there is replaced."""
    cache: Path = Path("runs/stimulus_front-cache")
    """Folder of finished closed loops, from which an interrupted run goes on."""


class Member(NamedTuple):
    """A point as it was run."""

    point: Point
    scores: dict[str, Any]  # as `point_scores`
    times: dict[str, np.ndarray]  # by rate, (n_lanes,) [s]


class Group(NamedTuple):
    """The points that count together: all trainings of the agent at a strength, else one point."""

    stimulus: str
    strength: float
    members: Sequence[Member]

    def times(self, rate: str) -> np.ndarray:
        """Isolation times [s], (n_members, n_lanes)."""
        return np.stack([member.times[rate] for member in self.members])

    def cost(self, part: str) -> dict[str, float]:
        """Mean costs of the members."""
        costs = [member.scores[part] for member in self.members]
        return {key: float(np.mean([one[key] for one in costs])) for key in costs[0]}


def main(arguments: StimulusFront) -> None:
    """Run the points and write results and page."""
    whole_number("per_class", arguments.per_class)
    whole_number("healthy", arguments.healthy)
    whole_number("workers", arguments.workers)
    finite_in_range("hours", arguments.hours, 0.01, 100.0)
    finite_in_range("seed", arguments.seed, 0, LARGEST_SEED)
    if arguments.suite not in SUITES:
        allowed = f"one of {', '.join(SUITES)}"
        raise refusal("suite", arguments.suite, allowed, "name one")
    chosen = [PASSIVE, REFERENCE, KNOWN_ONSET, *map(point_of, arguments.points)]
    points = list(dict.fromkeys(chosen))
    run_study("stimulus_front", arguments, lambda _: study(arguments, points), page)


def study(arguments: StimulusFront, points: Sequence[Point]) -> dict[str, Any]:
    """All results but the command."""
    suite = suites.load(arguments.suite)
    classes = SUBSETS["confounded"]
    sizes = arguments.per_class, arguments.healthy, arguments.hours
    lanes = lanes_of(suite, classes, *sizes, arguments.seed)
    runs = read_runs(arguments.cache, points, lanes, arguments.workers)
    groups = grouped(scored(runs, lanes))
    rows = [_row(group, groups, arguments.seed) for group in groups]
    mark_fronts(rows)
    return {
        "suite": {"name": suite.name, "hash": suite.hash},
        "classes": list(classes),
        "lanes": {part: len(episodes) for part, episodes in lanes.episodes.items()},
        "hours": arguments.hours,
        "seed": arguments.seed,
        "points": rows,
        "equal_cost": equal_cost(groups, arguments.seed),
    }


def scored(runs: Iterable[tuple[Point, FrontRuns]], lanes: FrontLanes) -> list[Member]:
    """The points with scores; the first is the passive one."""
    truth = lane_truth(lanes.conditions, lanes.episodes[FAULTY]).at_instants
    members: list[Member] = []
    passive: FrontRuns = {}
    for point, of_point in runs:
        passive = passive or of_point
        members.append(Member(point, *point_scores(of_point, passive, truth.fault, truth.onset)))
    return members


def grouped(members: Iterable[Member]) -> list[Group]:
    """The members that count together, in the order of their first ones."""
    groups: dict[tuple[str, float], list[Member]] = {}
    for member in members:
        name, strength = member.point
        family = AGENT if LEARNED.fullmatch(name) else name
        groups.setdefault((family, strength), []).append(member)
    found = []
    for (family, strength), of_group in groups.items():
        name = of_group[0].point.stimulus if len(of_group) == 1 else family
        found.append(Group(name, strength, of_group))
    return found


def _of(groups: Sequence[Group], point: Point) -> Group:
    return next(group for group in groups if tuple(group[:2]) == point)


def _row(group: Group, groups: Sequence[Group], seed: int) -> dict[str, Any]:
    """A point of the results."""
    reference = _of(groups, REFERENCE)
    with_onset = _of(groups, KNOWN_ONSET)
    rates = {}
    for rate in RATES:
        of_members = [member.scores["rates"][rate] for member in group.members]
        times = group.times(rate)
        rates[rate] = {
            "threshold": [one["threshold"] for one in of_members],
            "is_extrapolated": of_members[0]["is_extrapolated"],
            "detection": float(np.mean([one["detection"] for one in of_members])),
            "isolated": float(np.mean([one["isolated"] for one in of_members])),
            "false_alarms": [one["false_alarms"] for one in of_members],
            "isolation": compared(times, reference.times(rate), seed),
            "of_known_onset": compared(times, with_onset.times(rate), seed)["ratio"],
        }
    return {
        "stimulus": group.stimulus,
        "strength": group.strength,
        "members": len(group.members),
        "healthy": group.cost("healthy"),
        "faulty": group.cost("faulty"),
        "rates": rates,
    }


def mark_fronts(rows: Sequence[dict[str, Any]]) -> None:
    """Write into the rows, by cost, whether no other point improves a point in both.

    The reference that knows the onset does not compete.
    """
    competing = [row for row in rows if row["stimulus"] != FasterFromOnset.name]
    for row in rows:
        row["fronts"] = dict.fromkeys(COSTS, False)
    for key in COSTS:
        places = [
            (row["healthy"][key], row["rates"][RANKED_AT]["isolation"]["mean"][0])
            for row in competing
        ]
        for index in pareto_front(places):
            competing[index]["fronts"][key] = True


def equal_cost(groups: Sequence[Group], seed: int) -> Mapping[str, Any]:
    """Isolation at equal healthy cost; the passive run is the point of strength 0 of all."""
    passive = _of(groups, PASSIVE)
    names = dict.fromkeys(group.stimulus for group in groups)
    points = {}
    for name in names:
        if name in (Cruise.name, FasterFromOnset.name):
            continue
        of_name = [group for group in groups if group.stimulus == name]
        shape = of_name[0].times(RANKED_AT).shape
        at_rest = np.broadcast_to(passive.times(RANKED_AT), shape)
        costs = [0.0, *(group.cost("healthy")["rms"] for group in of_name)]
        points[name] = costs, [at_rest, *(group.times(RANKED_AT) for group in of_name)]
    return at_costs(points, EQUAL_COSTS, _of(groups, REFERENCE).times(RANKED_AT), seed)


if __name__ == "__main__":
    command_line(main)
