import pytest

from auv_fault_env.faults import NORMAL, UNKNOWN, classes
from diagnosers.advisory import ACTIONS
from training.live.badges import BAD, CAUTION, GOOD, badges


@pytest.mark.parametrize("action", ACTIONS)
@pytest.mark.parametrize("verdict", classes())
def test_alarm_and_advice_agree(verdict, action):
    alarm, advice = badges(verdict, action)
    is_good = verdict == NORMAL and action == "continue"
    assert (alarm.colour == GOOD) == is_good
    assert (advice.colour == GOOD) == is_good
    assert (alarm.colour == BAD) == (verdict != NORMAL)
    assert (alarm.text == "no alarm") == (verdict == NORMAL)
    assert advice.text.startswith(f"advice: {action}")


def test_a_mission_that_goes_on_with_a_fault_says_so():
    alarm, advice = badges("propeller_loss:port", "continue")
    assert alarm.text == "alarm: propeller_loss:port"
    assert advice == ("advice: continue with the fault, with caution", CAUTION)
    assert badges(UNKNOWN, "abort")[0].text == "alarm: unknown fault"


def test_actions_of_other_urgency_have_other_colours():
    assert len({badges("increased_drag", action)[1].colour for action in ACTIONS}) == 4 - 1
    assert len({badges(NORMAL, action)[1].colour for action in ACTIONS}) == 4
