"""Short runs past a diagnoser."""

from functools import cache

from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import MISSIONS
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief, make
from training.rollouts import roll_out


@cache
def final_belief(name: str, fault: str | None, severity: float = 0.95) -> Belief:
    """What a diagnoser believes at 59.4 s of the thesis' stimulus, at the higher of its speeds.

    The vehicle is nominal, its fault begins at 5 s.
    """
    fleet = Fleet(1, healthy_band=0.0)
    schedule = (FaultEvent(fault, onset=5.0, severity=severity),) if fault else ()
    rollout = roll_out(fleet, [1], 595, schedules=[schedule], missions=[MISSIONS["thesis"]])
    diagnoser = make(name)
    diagnoser.reset(1)
    for observation in rollout.observations:
        belief = diagnoser.update(observation)
    return belief
