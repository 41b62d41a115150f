"""The two badges on top of the live page, alarm and advice, which never contradict each other."""

from typing import NamedTuple

from auv_fault_env.faults import NORMAL, UNKNOWN
from diagnosers.advisory import ACTIONS

GOOD = "positive"
NEUTRAL = "blue-grey"
CAUTION = "amber"
SERIOUS = "deep-orange"
BAD = "negative"
CONTINUE = ACTIONS[0]
COLOURS = dict(zip(ACTIONS, (GOOD, CAUTION, SERIOUS, BAD), strict=True))
UNKNOWN_FAULT = "unknown fault"


class Badge(NamedTuple):
    """Text, and colour by its name in Quasar."""

    text: str
    colour: str


def badges(verdict: str, action: str) -> tuple[Badge, Badge]:
    """Alarm and advice.

    Green stands only where no alarm stands and the mission goes on: a mission that goes on in
    spite of an alarm asks for caution, and where the advice is more than to continue, the missing
    alarm is no good news.

    Parameters
    ----------
    verdict
        `normal` while no alarm stands, else the class of the fault.
    action
        One of `ACTIONS`.
    """
    has_alarm = verdict != NORMAL
    advice = Badge(f"advice: {action}", COLOURS[action])
    if has_alarm and action == CONTINUE:
        advice = Badge("advice: continue with the fault, with caution", CAUTION)
    if has_alarm:
        fault = UNKNOWN_FAULT if verdict == UNKNOWN else verdict
        return Badge(f"alarm: {fault}", BAD), advice
    return Badge("no alarm", GOOD if action == CONTINUE else NEUTRAL), advice
