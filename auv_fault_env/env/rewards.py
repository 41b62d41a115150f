"""The reward of a step: what a deviation from the mission, energy and fins cost."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from auv_fault_env import layout
from auv_fault_env.errors import finite_in_range, known_name, refusal
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import ENERGY_WEIGHT


@dataclass(frozen=True)
class RewardWeights:
    """What is charged for a step; by default as in `Propulsion-v0`."""

    speed: float = 1.0  # s^2/m^2, of the squared deviation of the true speed
    energy: float = ENERGY_WEIGHT  # 1/J, of the electrical energy
    deflection: float = 0.0  # 1/rad^2, of rudder and stern plane, squared and summed

    def __post_init__(self):
        for spec in fields(self):
            finite_in_range(f"reward weight {spec.name}", getattr(self, spec.name), 0.0, 1e6)

    @classmethod
    def of(cls, weights: Mapping[str, float] | None) -> "RewardWeights":
        """The weights of a mapping; those that it lacks are the usual ones."""
        if not isinstance(weights, Mapping | None):
            allowed = "a mapping of speed, energy, deflection"
            raise refusal("reward_weights", weights, allowed, "give some of them")
        for name in weights or {}:
            known_name("reward weight", name, [spec.name for spec in fields(cls)])
        given = cls(**(weights or {}))
        return USUAL if given == USUAL else given


USUAL = RewardWeights()


def rewards(weights: RewardWeights, fleet: Fleet) -> np.ndarray:
    """The reward of the last step, (n_lanes,)."""
    if weights is USUAL:  # equality would take longer than all the rest
        return fleet.outcomes[0]
    _, energy, cost, _ = fleet.outcomes
    deflection = fleet.row(layout.RUDDER) ** 2 + fleet.row(layout.STERN_PLANE) ** 2
    return -weights.speed * cost - weights.energy * energy - weights.deflection * deflection
