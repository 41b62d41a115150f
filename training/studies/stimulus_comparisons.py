"""How much sooner faults are isolated under one stimulus than under another, on the same episodes.

Pure functions of isolation times by stimulus, (n_members, n_lanes) [s]: one member, or one for each
training seed of the agent. A triple is a figure and the ends of its 95 % interval.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from training.benchmark.scores import RANKED_AT
from training.metrics.intervals import central, resamples
from training.metrics.records import HORIZON
from training.stimuli.open_loop import Cruise, Thesis

# the stimuli of the agent, one for each seed of its training
LEARNED = re.compile(r"learned(_\d+)?")
AGENT = "learned, all seeds"
REFERENCES = (Thesis.name, Cruise.name)
SUBSETS = {
    "all": (),  # classes; every class where none is named
    "confounded": (  # at constant speed they hardly differ
        *("increased_drag", "decreased_drag", "sensor:speed"),
        *(
            "propeller_damage:port",
            "propeller_damage:starboard",
            "propeller_loss:port",
            "propeller_loss:starboard",
        ),
    ),
}
COSTS = ("speed_rms", "energy")

Triple = Sequence[float]
Figures = dict[str, Any]


def rivals(names: Iterable[str]) -> list[str]:
    """The stimuli that watch the belief as the agent does, but have learnt nothing."""
    return [name for name in names if name.startswith("triggered_") or name == "greedy"]


def shown(names: Iterable[str]) -> list[str]:
    """The names without the agent's single seeds, their mean first."""
    return sorted(
        (name for name in names if not LEARNED.fullmatch(name)), key=lambda name: name != AGENT
    )


def with_agent(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Values (n_members, ...) by stimulus, those of the agent's seeds once more together, as `AGENT`."""
    seeds = [values[name] for name in values if LEARNED.fullmatch(name)]
    return dict(values) | ({AGENT: np.concatenate(seeds)} if seeds else {})


def compared(
    scores: Mapping[str, Any], diagnoser: str, fault: Sequence[str], seed: int
) -> dict[str, Any]:
    """By subset of the lanes, those of `SUBSETS` and every class, and by stimulus the figures of `paired`.

    Parameters
    ----------
    scores
        Of a benchmark, by stimulus and diagnoser.
    fault
        True class of each lane, (n_lanes,).
    seed
        Of the bootstrap.
    """
    times = {
        name: np.array([by[diagnoser]["by_lane"]["isolation"]], float)
        for name, by in scores.items()
    }
    times = with_agent(times)
    fault = np.asarray(fault)
    subsets = SUBSETS | {str(name): (name,) for name in dict.fromkeys(fault.tolist())}
    chosen = {name: np.isin(fault, classes or fault) for name, classes in subsets.items()}
    return {
        name: paired({one: values[:, lanes] for one, values in times.items()}, seed)
        for name, lanes in chosen.items()
        if lanes.any()
    }


def paired(times: Mapping[str, np.ndarray], seed: int) -> dict[str, Figures]:
    """Figures of every stimulus on the same lanes.

    mean
        Restricted mean of the isolation time [s], a triple.
    spread
        Standard deviation of the members' means [s], None for one member.
    isolated
        Share of the lanes isolated before the horizon.
    difference, ratio
        Of the mean to that of others, triples: of `REFERENCES`, and for the agent of its `rivals`
        as well. Every resample draws the same lanes for both, and members of its own for the agent.

    Misleads: a handful of training seeds resampled is no more than a handful; theirs is rather too
    short an interval.
    """
    lanes = resamples(next(iter(times.values())).shape[1], seed)
    drawn = {name: resampled_means(values, lanes, seed) for name, values in times.items()}
    mean = {name: float(values.mean()) for name, values in times.items()}
    found = {}
    for name, values in times.items():
        others = [*REFERENCES, *(rivals(times) if name == AGENT else ())]
        found[name] = {
            "mean": [mean[name], *central(drawn[name])],
            "spread": float(values.mean(axis=1).std(ddof=1)) if len(values) > 1 else None,
            "isolated": float((values < HORIZON).mean()),
            "difference": {
                one: [mean[name] - mean[one], *central(drawn[name] - drawn[one])]
                for one in others
                if one in times
            },
            "ratio": {
                one: [mean[name] / mean[one], *central(drawn[name] / drawn[one])]
                for one in others
                if one in times
            },
        }
    return found


def speed_up(ratio: Triple) -> list[float]:
    """How many times sooner, from how many times as long; triples both."""
    value, low, high = ratio
    return [1.0 / value, 1.0 / high, 1.0 / low]


def resampled_means(values: np.ndarray, lanes: np.ndarray, seed: int) -> np.ndarray:
    """Means (n,) of values (n_members, n_lanes) over resamples of lanes (n, n_lanes), and of members if there are any.

    Both are drawn, the members apart from the lanes: what is said is said of other vehicles and of
    other trainings.
    """
    members = resamples(len(values), [seed, 1], len(lanes))
    return (members * (lanes @ values.T)).sum(axis=1) / values.size


def costs(scores: Mapping[str, Any], diagnoser: str) -> dict[str, dict[str, float]]:
    """By stimulus what the faulty episodes cost (`COSTS`), and the false alarms per hour on healthy ones."""
    values = {name: np.array([_costs(by[diagnoser])]) for name, by in scores.items()}
    keys = *COSTS, "false_alarms_per_hour"
    return {
        name: dict(zip(keys, members.mean(axis=0).tolist(), strict=True))
        for name, members in with_agent(values).items()
    }


def _costs(score: Mapping[str, Any]) -> list[float]:
    return [
        *(score["cost"][key] for key in COSTS),
        score["rates"][RANKED_AT]["false_alarms_per_hour"],
    ]


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Places of the points (cost, delay) to which no other is better in one and as good in the other, by their cost.

    >>> front([(1.0, 5.0), (2.0, 5.0), (3.0, 1.0), (2.0, 4.0)])
    [0, 3, 2]
    """
    found: list[int] = []
    for place in sorted(range(len(points)), key=points.__getitem__):
        if not found or points[place][1] < points[found[-1]][1]:
            found.append(place)
    return found
