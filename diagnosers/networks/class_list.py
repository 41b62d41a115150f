"""The classes that a network was trained on, and beliefs over more classes than these.

A class that joins later, that of an added fault or `unknown`, is a hypothesis of the filter bank
beside the network. By Bayes' rule, with T the classes of the training and y the readings,

    p(added class | y) = p_bank(added class | y)
    p(trained class | y) = p_bank(T | y) p_network(trained class | y, T)
"""

from collections.abc import Sequence

import numpy as np

from auv_fault_env.errors import refusal
from auv_fault_env.faults import NORMAL, UNKNOWN
from auv_fault_env.parameters import SIDES
from diagnosers.diagnoser import Belief

_OF_SIDE = (
    "propeller_damage",
    "propeller_loss",
    "seal_friction",
    "motor_overheating",
)
_OF_SENSORS = ("voltage", "current", "rpm")
# of weights that do not name theirs; without `unknown`
SHIPPED_CLASSES = (
    *("normal", "increased_drag", "decreased_drag"),
    *(f"{fault}:{side}" for side in SIDES for fault in _OF_SIDE),
    *("sensor:speed", "sensor:acceleration"),
    *(f"sensor:{side}_{reading}" for side in SIDES for reading in _OF_SENSORS),
)


def check_class_list(trained: Sequence[str], catalogue: Sequence[str]) -> tuple[str, ...]:
    """The classes of a training, `normal` first, if the catalogue has all of them; else refused."""
    is_list = isinstance(trained, (list, tuple)) and all(isinstance(name, str) for name in trained)
    if not is_list or tuple(trained[:1]) != (NORMAL,) or len(set(trained)) < len(trained):
        allowed = f"different names, {NORMAL!r} first"
        raise refusal("classes of the weights", trained, allowed, "take other weights")
    if missing := [name for name in trained if name not in catalogue]:
        allowed = f"classes of the catalogue: {', '.join(catalogue)}"
        raise refusal(
            "classes of the weights",
            missing,
            allowed,
            "add these faults, or train anew",
        )
    return tuple(trained)


def is_fault(name: str) -> bool:
    """Whether a class is a fault, which has a severity; `normal` and `unknown` have none."""
    return name not in (NORMAL, UNKNOWN)


def with_added_classes(network: Belief, bank: Belief, trained: Sequence[int]) -> Belief:
    """The belief over all classes from the network's over the trained ones and the bank's over all.

    trained (n_trained,) are the columns of the network's classes among all. The bank also gives the
    severities of the added classes.
    """
    log_trained = np.logaddexp.reduce(bank.log_probability[:, trained], axis=1, keepdims=True)
    belief = Belief(*(values.copy() for values in bank))
    belief.log_probability[:, trained] = network.log_probability + log_trained
    belief.severity_mean[:, trained] = network.severity_mean
    belief.severity_std[:, trained] = network.severity_std
    return belief
