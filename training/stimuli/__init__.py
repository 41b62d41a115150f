"""The stimuli by name, all compared under the same budget."""

from training.stimuli.base import BUDGET, EPISODE_TIME, Stimulus
from training.stimuli.greedy import Greedy
from training.stimuli.learned import (
    Learned,
    Learned1,
    Learned2,
    Learned3,
    Learned4,
    LearnedHeld,
)
from training.stimuli.open_loop import Constant, Cruise, DOptimal, Multisine, Prbs, Thesis
from training.stimuli.planner import Planner
from training.stimuli.standing import StandingSurge
from training.stimuli.thrust_shift import TriggeredShift
from training.stimuli.triggered import (
    TriggeredDOptimal,
    TriggeredPrbs,
    TriggeredThesis,
)
from training.stimuli.triggered_surge import TriggeredSurge
from training.stimuli.two_experiments import TwoExperiments

__all__ = ["BUDGET", "EPISODE_TIME", "STIMULI", "Cruise", "Stimulus", "Thesis"]

STIMULI: dict[str, type[Stimulus]] = {
    "cruise": Cruise,
    "thesis": Thesis,
    "prbs": Prbs,
    "multisine": Multisine,
    "d_optimal": DOptimal,
    "triggered_thesis": TriggeredThesis,
    "triggered_prbs": TriggeredPrbs,
    "triggered_d_optimal": TriggeredDOptimal,
    "greedy": Greedy,
    "triggered_surge": TriggeredSurge,
    "learned": Learned,
    "learned_1": Learned1,
    "learned_2": Learned2,
    "learned_3": Learned3,
    "learned_4": Learned4,
    "learned_held": LearnedHeld,
    "constant": Constant,
    "standing_surge": StandingSurge,
    "two_experiments": TwoExperiments,
    "triggered_shift": TriggeredShift,
    "planner": Planner,
}
