"""The question of the thesis at equal capacity: whether raw data, filters, or both diagnose best.

Run ``python -m training.studies.ablation``. The same network is trained on raw data, on the hull
filter, on the motor filter, on both, on raw data and filters, on the belief of the filter bank, and
on all of it, with several seeds, on episodes with the imperfections of real sensors. It is scored
on the suite `standard` as the diagnosers are. The physical residuals that `integrated` has, too,
are no input here.

The half seconds limit how soon a network can react. The severity is not learnt.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from auv_fault_env.errors import finite_in_range
from auv_fault_env.faults import CATALOGUE, NORMAL, UNKNOWN, classes
from training.learning.episode_sets import LANES
from training.metrics import class_f1, confusion, macro_f1
from training.metrics.intervals import central, interval, resampled_f1
from training.studies.ablation_costs import costs
from training.studies.ablation_inputs import INPUTS
from training.studies.ablation_page import page
from training.studies.ablation_runs import AblationRuns
from training.studies.run import command_line, run_study

NETWORKS = 3  # of each input, with successive seeds
REFERENCE = "filter_bank"  # a diagnoser on the same lanes
GROUPS = {  # of classes, by the component of their faults
    "hull": ("hull",),
    "propellers": ("propeller",),
    "motors": ("shaft", "motor"),
    "sensors": ("sensor",),
}
# each answers one question: the second with the first beside it
COMPARED = (
    ("raw", "hull filter"),
    ("raw", "both filters"),
    ("raw", "raw and filters"),
    ("both filters", "raw and filters"),
    ("bank", "bank, raw and filters"),
)
ENOUGH = 0.9  # share of the final macro-F1


@dataclass(frozen=True)
class AblationStudy:
    """Train the same network on raw data, on filters, and on both, and score it."""

    output: Path = Path("runs/ablation")
    """Folder of the results; an earlier run there is replaced."""
    cache: Path = Path("runs/ablation-cache")
    """Folder of features and finished networks, from which a stopped run goes on."""
    sets: int = 80
    """Sets of 512 training episodes."""
    passes: int = 4
    """How often each network is trained over them."""
    hours: float = 20.0
    """Healthy operation to set thresholds on, and as much to count false alarms on [h]."""
    every: int = 2
    """k: each k-th faulty episode of the suite is scored."""
    workers: int = -1
    """Processes; -1 is one per core."""
    seed: int = 0
    """Of the first network of each input."""


def main(arguments: AblationStudy) -> None:
    """Compute what is missing in the cache, and write results and page."""
    finite_in_range("sets", arguments.sets, 1, 1000)
    finite_in_range("passes", arguments.passes, 1, 100)
    finite_in_range("hours", arguments.hours, 0.1, 1000.0)
    finite_in_range("every", arguments.every, 1, 100)
    finite_in_range("seed", arguments.seed, 0, 1_000_000)
    run_study("ablation", arguments, lambda folder: study(arguments), page)


def study(arguments: AblationStudy) -> dict[str, Any]:
    """Figures of every input and of the reference, as plain data."""
    runs = AblationRuns(
        cache=arguments.cache,
        sets=arguments.sets,
        passes=arguments.passes,
        hours=arguments.hours,
        every=arguments.every,
        workers=arguments.workers,
        seed=arguments.seed,
    )
    files = runs.simulate()
    architecture, losses = runs.architecture(files)
    seeds = range(arguments.seed, arguments.seed + NETWORKS)
    networks = runs.networks(files, architecture, list(product(INPUTS, seeds)))
    of_inputs = {
        inputs: [network for network in networks if network["inputs"] == inputs]
        for inputs in INPUTS
    }
    reference = {REFERENCE: [runs.diagnoser(files, REFERENCE)]}
    spent = costs(architecture, arguments.seed)
    return {
        "episodes": arguments.sets * LANES,
        "passes": arguments.passes,
        "architecture": str(architecture),
        "architecture_losses": losses,
        "n_networks": NETWORKS,
        "scores": {
            name: score(of_name, arguments.seed)
            for name, of_name in (of_inputs | reference).items()
        },
        "costs": spent,
        "curves": {inputs: curves(of_name) for inputs, of_name in of_inputs.items()},
        "compared": [
            {"first": first, "second": second}
            | {
                group: difference(of_inputs[first], of_inputs[second], group, arguments.seed)
                for group in ("all", *GROUPS)
            }
            for first, second in COMPARED
        ],
    }


def score(networks: Sequence[Mapping[str, Any]], seed: int) -> dict[str, Any]:
    """Figures over the networks of an input: means, with intervals over the lanes."""
    isolation = mean_of(networks, "isolation")
    detection = mean_of(networks, "detection")
    resampled = []
    matrices = []
    for network in networks:
        label = np.array(network["label"])
        decision = np.array(network["decision"])
        resampled.append(resampled_f1(label, decision, len(classes()), seed))
        matrices.append(confusion(label, decision, len(classes())))
    f1 = class_f1(np.array(matrices)).mean(axis=0)
    of_group = {name: members(name) for name in GROUPS}
    fault = fault_of_lanes(networks[0])
    return {
        "isolation": float(isolation.mean()),
        "isolation_interval": interval(isolation, seed),
        "isolation_of_networks": [network["restricted_mean"] for network in networks],
        "isolated": float(mean_of(networks, "isolated").mean()),
        "detection": float(detection.mean()),
        "detection_interval": interval(detection, seed),
        "macro_f1": float(macro_f1(np.array(matrices)).mean()),
        "macro_f1_interval": central(np.mean(resampled, axis=0)),
        "f1_of_groups": {name: float(f1[chosen].mean()) for name, chosen in of_group.items()},
        "isolation_of_groups": {
            name: float(isolation[np.isin(fault, chosen)].mean())
            for name, chosen in of_group.items()
        },
        "ece": float(np.mean([network["ece"] for network in networks])),
        "false_alarms": sum(network["false_alarms"] for network in networks),
        "hours": sum(network["hours"] for network in networks),
    }


def mean_of(networks: Sequence[Mapping[str, Any]], key: str) -> np.ndarray:
    """The mean over the networks, by faulty lane."""
    return np.mean([network[key] for network in networks], axis=0)


def fault_of_lanes(network: Mapping[str, Any]) -> np.ndarray:
    """The classes of the faulty lanes, which are the first of the labels."""
    return np.array(network["label"])[: len(network["isolation"])]


def members(group: str) -> list[int]:
    """Indices of the classes of a group, or of all faults."""
    component = {fault.diagnosis: fault.component for fault in CATALOGUE.values()}
    names = [name for name in classes() if name not in (NORMAL, UNKNOWN)]
    if group == "all":
        return [classes().index(name) for name in names]
    kinds = GROUPS[group]
    chosen = [name for name in names if component[name].partition(":")[0] in kinds]
    return [classes().index(name) for name in chosen]


def difference(
    first: Sequence[Mapping[str, Any]],
    second: Sequence[Mapping[str, Any]],
    group: str,
    seed: int,
) -> dict[str, Any]:
    """Isolation time of the second input minus that of the first on the lanes of a group [s]."""
    chosen = np.isin(fault_of_lanes(first[0]), members(group))
    change = (mean_of(second, "isolation") - mean_of(first, "isolation"))[chosen]
    return {"mean": float(change.mean()), "interval": interval(change, seed)}


def curves(networks: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Progress over the training, mean over the networks, and after which episodes it is enough."""
    histories = [network["history"] for network in networks]
    mean = {
        key: np.mean([[one[key] for one in history] for history in histories], axis=0)
        for key in ("episodes", "training_loss", "validation_loss", "macro_f1")
    }
    enough = mean["macro_f1"] >= ENOUGH * mean["macro_f1"][-1]
    plain = {key: values.tolist() for key, values in mean.items()}
    return plain | {"episodes_enough": float(mean["episodes"][enough.argmax()])}


if __name__ == "__main__":
    command_line(main)
