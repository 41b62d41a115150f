"""What is true behind the readings: label, severities, onset, parameters, noise-free state. For scoring only."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from auv_fault_env import layout
from auv_fault_env.errors import known_name
from auv_fault_env.faults import NORMAL, classes
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.physics import RPM
from auv_fault_env.schedules import first_onset

# Noise-free state by memory row and unit factor.
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
    """The truth of a step as arrays (n_lanes,), each read afresh when asked for: reading all costs more than a step.

    It speaks for one step only; keep ``dict(info["truth"])`` where it is to outlive the step.
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
            raise RuntimeError(
                f"truth[{key!r}]: got a later step; allowed is its own step; keep dict(info['truth'])"
            )
        return self._readers[known_name("truth", key, self._readers)]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)

    def _row(self, index: int) -> np.ndarray:
        return self._fleet.table[:, index].reshape(-1)[: self._fleet.n_lanes].copy()

    def _parameters(self) -> dict[str, np.ndarray]:
        return {name: self._row(layout.PARAMETER + p) for p, name in enumerate(PARAMETERS)}

    def _state(self) -> dict[str, np.ndarray]:
        return {name: factor * self._row(index) for name, (index, factor) in STATE.items()}

    def _onset(self) -> np.ndarray:
        return first_onset(self._fleet.plan)

    def _severity(self) -> dict[str, np.ndarray]:
        plan = self._fleet.plan
        names = classes()
        of_fault = np.array([names.index(diagnosis) for diagnosis in self._fleet.diagnoses])
        table = np.zeros((len(names), self._fleet.n_lanes))
        lanes = np.arange(self._fleet.n_lanes)
        for fault, severity in zip(plan.fault.T, plan.severity.T, strict=True):
            np.maximum.at(table, (np.where(fault >= 0, of_fault[fault], 0), lanes), severity)
        return dict(zip(names[1:], table[1:], strict=True))

    def _label(self) -> np.ndarray:
        plan = self._fleet.plan
        lanes = np.arange(self._fleet.n_lanes)
        if not plan.severity.size:
            return np.full(lanes.size, NORMAL)
        worst = plan.severity.argmax(axis=1)
        active = plan.severity[lanes, worst] > 0.0
        return np.where(active, self._fleet.diagnoses[plan.fault[lanes, worst]], NORMAL)


class SingleLaneTruth:
    """The truth of one lane in plain numbers; what changes only with the faults is read anew only then."""

    def __init__(self, fleet: Fleet, lane: int = 0):
        self._fleet = fleet
        self._lane = lane
        self._seen = -1
        first = lane // layout.LANES * layout.N_ROWS * layout.LANES + lane % layout.LANES
        self._state_at = first + layout.LANES * np.array([row for row, _ in STATE.values()])
        self._state_factors = np.array([factor for _, factor in STATE.values()])

    def read(self) -> dict[str, Any]:
        """A fresh dictionary: label, severity by class, onset [s], parameters and noise-free state by name."""
        if self._seen != self._fleet.changes:
            self._read_faults()
        state = (self._fleet.state.memory.take(self._state_at) * self._state_factors).tolist()
        return {
            "label": self._label,
            "severity": self._severity.copy(),
            "onset": self._onset,
            "parameters": self._parameters.copy(),
            "state": dict(zip(STATE, state, strict=True)),
        }

    def _read_faults(self):
        plan = self._fleet.plan
        self._seen = self._fleet.changes
        column = self._fleet.table[
            self._lane // layout.LANES, layout.PARAMETER :, self._lane % layout.LANES
        ]
        self._parameters = dict(zip(PARAMETERS, column.tolist(), strict=True))
        self._severity = dict.fromkeys(classes()[1:], 0.0)
        self._onset = float("inf")
        self._label = NORMAL
        worst = 0.0
        rows = (
            plan.fault[self._lane].tolist(),
            plan.severity[self._lane].tolist(),
            plan.profile[self._lane].tolist(),
        )
        for fault, severity, profile in zip(*rows, strict=True):
            if fault >= 0:
                name = str(self._fleet.diagnoses[fault])
                self._severity[name] = max(self._severity[name], severity)
                self._onset = min(self._onset, profile[0])
                if severity > worst:  # of equal ones the first event, as in `FleetTruth`
                    self._label = name
                    worst = severity
