"""The truth behind the readings, for scoring only: how much of it the information of a step has.

A level is one of `LEVELS`. ``"label"``: the class of the most severe fault as the number
`true_class`. ``"full"``: that, and a dictionary `truth`. False: nothing.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from auv_fault_env import layout
from auv_fault_env.compiling import kernel
from auv_fault_env.errors import known_name, refusal
from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.physics import RPM
from auv_fault_env.schedules import first_onset

# row of the memory and factor of the unit by name of the noise-free state
STATE: dict[str, tuple[int, float]] = {
    "speed": (layout.SPEED, 1.0),
    "acceleration": (layout.ACCELERATION, 1.0),
    "disturbance": (layout.DISTURBANCE, 1.0),
    "port_voltage": (layout.PORT_VOLTAGE, 1.0),
    "port_current": (layout.PORT_CURRENT, 1.0),
    "port_rpm": (layout.PORT_SHAFT_SPEED, RPM),
    "starboard_voltage": (layout.STARBOARD_VOLTAGE, 1.0),
    "starboard_current": (layout.STARBOARD_CURRENT, 1.0),
    "starboard_rpm": (layout.STARBOARD_SHAFT_SPEED, RPM),
}

LEVELS = ("full", "label", False)


def known_level(truth: str | bool) -> str | bool:
    """The level of the truth, if there is one of that name."""
    if any(truth is level or (level and truth == level) for level in LEVELS):
        return truth
    raise refusal("truth", truth, "'full', 'label' or False", "give one of them")


class FleetTruth(Mapping):
    """The truth of one step as arrays (n_lanes,), each computed when it is accessed.

    It is valid for its own step only; ``dict(info["truth"])`` keeps it for later.
    """

    def __init__(self, fleet: Fleet):
        self._fleet = fleet
        self._outcomes = fleet.outcomes
        self._readers: dict[str, Callable[[], Any]] = {
            "label": self._label,
            "severity": self._severity,
            "onset": self._onset,
            "parameters": self._parameters,
            "state": self._state,
        }

    def __getitem__(self, key: str):
        if self._fleet.outcomes is not self._outcomes:
            allowed = "its own step; keep dict(info['truth'])"
            raise RuntimeError(f"truth[{key!r}]: got a later step; allowed is {allowed}")
        return self._readers[known_name("truth", key, self._readers)]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)

    def _parameters(self) -> dict[str, np.ndarray]:
        return {name: self._fleet.row(layout.PARAMETER + p) for p, name in enumerate(PARAMETERS)}

    def _state(self) -> dict[str, np.ndarray]:
        return {name: factor * self._fleet.row(index) for name, (index, factor) in STATE.items()}

    def _onset(self) -> np.ndarray:
        return first_onset(self._fleet.plan)

    def _severity(self) -> dict[str, np.ndarray]:
        return severities(self._fleet.plan, self._fleet.class_of_fault, classes())

    def _label(self) -> np.ndarray:
        return np.array(classes())[worst_class(self._fleet.plan, self._fleet.class_of_fault)]


class Severities(Protocol):
    """The faults of lanes, and how far they have gone; both (n_lanes, n_events)."""

    fault: np.ndarray
    severity: np.ndarray


def severities(
    plan: Severities, class_of_fault: np.ndarray, names: Sequence[str]
) -> dict[str, np.ndarray]:
    """Largest severity (n_lanes,) of every class but the first, by name."""
    largest = np.zeros((len(names), len(plan.fault)))
    lanes = np.arange(len(plan.fault))
    for fault, severity in zip(plan.fault.T, plan.severity.T, strict=True):
        row = np.where(fault >= 0, class_of_fault[fault], 0)
        np.maximum.at(largest, (row, lanes), severity)
    return dict(zip(names[1:], largest[1:], strict=True))


def worst_class(plan: Severities, class_of_fault: np.ndarray) -> np.ndarray:
    """Class (n_lanes,) of the most severe fault, 0 for `normal`, from that of each fault.

    Of equally severe faults the first of the schedule counts.
    """
    return worst_classes(plan.fault, plan.severity, class_of_fault)


@kernel
def worst_classes(fault, severity, class_of_fault):
    """As `worst_class`, of the arrays of a plan."""
    true_class = np.zeros(len(fault), np.int64)
    for lane in range(len(fault)):
        largest = 0.0
        for e in range(fault.shape[1]):
            if severity[lane, e] > largest:
                largest = severity[lane, e]
                true_class[lane] = class_of_fault[fault[lane, e]]
    return true_class


def fleet_truth(fleet: Fleet, level: str | bool) -> dict[str, Any]:
    """The truth of all lanes for the information of a step, as arrays (n_lanes,)."""
    if not level:
        return {}
    truth = {"true_class": worst_class(fleet.plan, fleet.class_of_fault)}
    return truth | {"truth": dict(FleetTruth(fleet))} if level == "full" else truth


class SingleLaneTruth:
    """The truth of one lane in numpy scalars; what faults alone change is kept between changes."""

    def __init__(self, fleet: Fleet, lane: int = 0):
        self._fleet = fleet
        self._lane = lane
        # of the fleet, when the kept values were read
        self._changes = -1
        self._changes_of_class = -1
        self._block = lane // layout.LANES
        self._column = lane % layout.LANES
        first = self._block * layout.N_ROWS * layout.LANES + self._column
        rows = np.array([row for row, _ in STATE.values()])
        self._state_places = first + layout.LANES * rows
        self._state_factors = np.array([factor for _, factor in STATE.values()])

    def of_level(self, level: str | bool) -> dict[str, Any]:
        """The truth for the information of a step."""
        if not level:
            return {}
        if self._changes_of_class != self._fleet.changes:
            self._read_class()
        truth = {"true_class": self._class}
        return truth | {"truth": self.read()} if level == "full" else truth

    def read(self) -> dict[str, Any]:
        """A new dictionary of label, severity by class, onset [s], parameters and state by name."""
        if self._changes != self._fleet.changes:
            self._read_faults()
        if self._fleet.effects is not None:  # then heat changes parameters at every step
            self._read_parameters()
        values = self._fleet.state.memory.take(self._state_places)
        return {
            "label": self._label,
            "severity": self._severity.copy(),
            "onset": self._onset,
            "parameters": self._parameters.copy(),
            "state": dict(zip(STATE, values * self._state_factors, strict=True)),
        }

    def _read_parameters(self):
        rows = slice(layout.PARAMETER, layout.SURROUNDINGS)
        parameters = self._fleet.table[self._block, rows, self._column]
        self._parameters = dict(zip(PARAMETERS, parameters.copy(), strict=True))

    def _read_class(self):
        self._changes_of_class = self._fleet.changes
        self._class = np.int64(0)
        severities = self._fleet.plan.severity[self._lane]
        if severities.size and severities.max() > 0.0:
            event = severities.argmax()  # of equal ones the first, as in `worst_class`
            self._class = self._fleet.class_of_fault[self._fleet.plan.fault[self._lane, event]]

    def _read_faults(self):
        plan = self._fleet.plan
        self._changes = self._fleet.changes
        self._read_parameters()
        self._read_class()
        names = classes()
        self._label = names[self._class]
        self._severity = dict.fromkeys(names[1:], np.float64(0.0))
        for fault, severity in zip(plan.fault[self._lane], plan.severity[self._lane], strict=True):
            if fault >= 0:
                name = names[self._fleet.class_of_fault[fault]]
                self._severity[name] = max(self._severity[name], severity)
        self._onset = first_onset(plan)[self._lane]
