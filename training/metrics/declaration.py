"""The declared diagnosis: a fault is declared once one class has stayed probable for a second."""

from typing import NamedTuple

import numpy as np

from auv_fault_env.parameters import SAMPLE_RATE, SAMPLE_TIME
from training.metrics import NORMAL, ROUNDING, Times

DECLARATION_PROBABILITY = 0.9
DECLARATION_TIME = 1.0  # s


class Declared(NamedTuple):
    """The first declaration of each lane, (n_lanes,)."""

    named: np.ndarray  # class, `NORMAL` if nothing is declared
    time: np.ndarray  # s from the start, infinite if nothing is declared


class Declarations(NamedTuple):
    """What was declared within the horizon, (n_lanes,) bool; a lane is in one of the four."""

    right: np.ndarray
    wrong: np.ndarray
    abstained: np.ndarray  # `unknown` was declared of a fault that is known
    never: np.ndarray


def declare(fault: np.ndarray, log_fault: np.ndarray) -> Declared:
    """The first declaration of each lane; later ones do not count.

    Parameters
    ----------
    fault, log_fault
        Most probable fault and its log probability, (n_samples, n_lanes).

    A class is declared at the last sample of the first `DECLARATION_TIME` during which it has had
    at least `DECLARATION_PROBABILITY` at every sample. `normal` is never declared.
    """
    n_needed = round(DECLARATION_TIME * SAMPLE_RATE)
    is_sure = log_fault >= np.log(DECLARATION_PROBABILITY)
    begins = is_sure.copy()
    begins[1:] &= ~is_sure[:-1] | (fault[1:] != fault[:-1])
    index = np.arange(len(fault))[:, None]
    begun = np.maximum.accumulate(np.where(begins, index, -1), axis=0)
    is_declared = is_sure & (index - begun + 1 >= n_needed)
    first = is_declared.argmax(axis=0)
    is_any = is_declared.any(axis=0)
    named = np.where(is_any, fault[first, np.arange(fault.shape[1])], NORMAL)
    return Declared(named, np.where(is_any, first * SAMPLE_TIME, np.inf))


def judge(
    declared: Declared,
    is_right_class: np.ndarray,
    onset: np.ndarray,
    horizon: float,
    unknown: int,
) -> Declarations:
    """Whether each declaration is right.

    Parameters
    ----------
    is_right_class
        (n_lanes, n_classes) whether a class is a right name for the fault of the lane.
    onset, horizon
        (n_lanes,) and number [s]: a declaration up to the onset is wrong, one after the horizon
        comes too late and counts as none.
    unknown
        Index of the class `unknown`.

    Misleads: one wrong declaration that is taken back within two seconds counts as much as one
    that stays. Nothing is wrong of a diagnoser that never declares: read `wrong` beside `never`.
    """
    is_in_time = declared.time <= onset + horizon + ROUNDING
    is_early = declared.time <= onset + ROUNDING
    lanes = np.arange(len(onset))
    right = is_in_time & ~is_early & is_right_class[lanes, declared.named]
    is_named = is_in_time & ~right
    abstained = is_named & (declared.named == unknown)
    wrong = is_named & (declared.named != unknown)
    return Declarations(right, wrong, abstained, ~is_in_time)


def time_to_right(
    declared: Declared, judged: Declarations, onset: np.ndarray, horizon: float
) -> Times:
    """From onset to the right declaration [s]; all others are censored at the horizon.

    A wrong declaration counts like none: read it beside the share of wrong ones.
    """
    time = np.where(judged.right, declared.time - onset, horizon)
    return Times(time, ~judged.right)
