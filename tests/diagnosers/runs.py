"""Short runs past a diagnoser."""

from functools import cache

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief, make


@cache
def final_belief(name: str, fault: str | None, severity: float = 0.95) -> Belief:
    """What a diagnoser believes at 59.5 s of the thesis' stimulus, at the higher of its speeds.

    The vehicle is nominal, its fault begins at 5 s.
    """
    fleet = Fleet(1, healthy_band=0.0)
    schedule = (FaultEvent(fault, onset=5.0, severity=severity),) if fault else ()
    observation = fleet.reset([1], schedules=[schedule], missions=[MISSIONS["thesis"]])
    diagnoser = make(name)
    diagnoser.reset(1)
    for _ in range(595):
        belief = diagnoser.update(observation)
        observation = fleet.step(observation[:, :1] * [1.0, 0.0, 0.0])
    return belief
