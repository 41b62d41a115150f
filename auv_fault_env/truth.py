"""The truth behind the readings, for scoring only."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from auv_fault_env import layout
from auv_fault_env.errors import known_name
from auv_fault_env.faults import NORMAL, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.physics import RPM
from auv_fault_env.schedules import first_onset, profile_of

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

    def _row(self, index: int) -> np.ndarray:
        """One row of the memory, (n_lanes,)."""
        row = self._fleet.table[:, index].reshape(-1)
        return row[: self._fleet.n_lanes].copy()

    def _parameters(self) -> dict[str, np.ndarray]:
        return {name: self._row(layout.PARAMETER + p) for p, name in enumerate(PARAMETERS)}

    def _state(self) -> dict[str, np.ndarray]:
        return {name: factor * self._row(index) for name, (index, factor) in STATE.items()}

    def _onset(self) -> np.ndarray:
        return first_onset(self._fleet.plan)

    def _severity(self) -> dict[str, np.ndarray]:
        plan = self._fleet.plan
        names = classes()
        class_of_fault = [names.index(name) for name in self._fleet.diagnoses]
        class_of_fault = np.array(class_of_fault)
        largest = np.zeros((len(names), self._fleet.n_lanes))
        lanes = np.arange(self._fleet.n_lanes)
        for fault, severity in zip(plan.fault.T, plan.severity.T, strict=True):
            row = np.where(fault >= 0, class_of_fault[fault], 0)
            np.maximum.at(largest, (row, lanes), severity)
        return dict(zip(names[1:], largest[1:], strict=True))

    def _label(self) -> np.ndarray:
        plan = self._fleet.plan
        lanes = np.arange(self._fleet.n_lanes)
        if not plan.severity.size:
            return np.full(lanes.size, NORMAL)
        worst = plan.severity.argmax(axis=1)
        is_faulty = plan.severity[lanes, worst] > 0.0
        diagnosis = self._fleet.diagnoses[plan.fault[lanes, worst]]
        return np.where(is_faulty, diagnosis, NORMAL)


class SingleLaneTruth:
    """The truth of one lane in plain numbers; what only faults change is cached between changes."""

    def __init__(self, fleet: Fleet, lane: int = 0):
        self._fleet = fleet
        self._lane = lane
        self._changes = -1  # of the fleet, when the cached values were read
        self._block = lane // layout.LANES
        self._column = lane % layout.LANES
        first = self._block * layout.N_ROWS * layout.LANES + self._column
        rows = np.array([row for row, _ in STATE.values()])
        self._state_places = first + layout.LANES * rows
        self._state_factors = np.array([factor for _, factor in STATE.values()])

    def read(self) -> dict[str, Any]:
        """A new dictionary of label, severity by class, onset [s], parameters and state by name."""
        if self._changes != self._fleet.changes:
            self._read_faults()
        if self._fleet.effects.size:  # then heat changes parameters at every step
            self._read_parameters()
        values = self._fleet.state.memory.take(self._state_places)
        state = (values * self._state_factors).tolist()
        return {
            "label": self._label,
            "severity": self._severity.copy(),
            "onset": self._onset,
            "parameters": self._parameters.copy(),
            "state": dict(zip(STATE, state, strict=True)),
        }

    def _read_parameters(self):
        rows = slice(layout.PARAMETER, layout.SURROUNDINGS)
        parameters = self._fleet.table[self._block, rows, self._column]
        self._parameters = dict(zip(PARAMETERS, parameters.tolist(), strict=True))

    def _read_faults(self):
        plan = self._fleet.plan
        self._changes = self._fleet.changes
        self._read_parameters()
        self._severity = dict.fromkeys(classes()[1:], 0.0)
        self._onset = math.inf
        self._label = NORMAL
        worst = 0.0
        faults = plan.fault[self._lane].tolist()
        severities = plan.severity[self._lane].tolist()
        onsets = profile_of(plan).onset[self._lane].tolist()
        for fault, severity, onset in zip(faults, severities, onsets, strict=True):
            if fault < 0:
                continue
            name = str(self._fleet.diagnoses[fault])
            self._severity[name] = max(self._severity[name], severity)
            self._onset = min(self._onset, onset)
            if severity > worst:  # of equal severities the first event, as in `FleetTruth`
                self._label = name
                worst = severity
