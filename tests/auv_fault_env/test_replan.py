import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission
from auv_fault_env.schedules import FaultEvent
from auv_fault_env.truth import FleetTruth

EARLY = FaultEvent("increased_drag", 1.0, 0.6, ramp=2.0)
LATE = FaultEvent("sensor_stuck:speed", 2.0, 0.7)
SLOW = Mission(((0.0, 0.3),))
FAST = Mission(((0.0, 0.3), (2.0, 0.5)))


def fly(fleet, n_samples):
    observations = []
    for _ in range(n_samples):
        action = np.zeros((fleet.n_lanes, 3))
        action[:, 0] = fleet.table[0, 0, : fleet.n_lanes]
        observations.append(fleet.step(action))
    return np.array(observations)


def test_a_plan_made_under_way_is_as_good_as_one_made_before():
    planned = Fleet(2)
    replanned = Fleet(2)
    planned.reset([1, 2], schedules=[(EARLY, LATE), (LATE,)], missions=[FAST, SLOW])
    replanned.reset([1, 2], schedules=[(EARLY,), ()], missions=[SLOW, SLOW])
    whole = fly(planned, 40)
    begun = fly(replanned, 20)
    replanned.replan(schedules=[(EARLY, LATE), (LATE,)], missions=[FAST, SLOW])
    np.testing.assert_array_equal(np.concatenate([begun, fly(replanned, 20)]), whole)


def test_an_empty_schedule_repairs_and_leaves_the_mission():
    fleet = Fleet(1)
    fleet.reset([1], schedules=[(EARLY,)], missions=[FAST])
    fly(fleet, 35)
    assert FleetTruth(fleet)["label"][0] == "increased_drag"
    fleet.replan(schedules=[()])
    observations = fly(fleet, 1)
    assert FleetTruth(fleet)["label"][0] == "normal"
    assert FleetTruth(fleet)["parameters"]["alpha"][0] == fleet.plan.healthy[0, 0]
    assert observations[0, 0, 0] == np.float32(0.5)


@pytest.mark.parametrize(
    "plan", [{"schedules": [()] * 3}, {"missions": [SLOW]}], ids=["schedules", "missions"]
)
def test_another_number_than_that_of_the_lanes_is_refused(plan):
    fleet = Fleet(2)
    fleet.reset([1, 2])
    with pytest.raises(InputError, match=f"number of {next(iter(plan))}"):
        fleet.replan(**plan)


def test_there_is_nothing_to_replan_before_a_reset():
    with pytest.raises(InputError, match="replan: got 'no reset before'"):
        Fleet(1).replan(schedules=[()])
