"""What vehicles do, how real they are and which faults they have in training episodes."""

import numpy as np
import pytest

from auv_fault_env import CATALOGUE, UNMODELLED, Fleet, classes, layout
from auv_fault_env.channels import INDEX
from auv_fault_env.faults import matrices
from auv_fault_env.missions import MISSIONS
from auv_fault_env.parameters import PARAMETERS
from auv_fault_env.realism import EFFECTS
from auv_fault_env.schedules import FaultEvent, ScheduleSampler, events_of
from auv_fault_env.unmodelled import plant_faults
from training.learning.episodes import (
    LARGEST_REALISM,
    course_with_rests,
    drawn_realism,
    later,
    training_episodes,
)
from training.learning.unknown_faults import random_fault, with_unknown_faults
from training.rollouts import roll_out

UNKNOWN = classes().index("unknown")
MISSION_SPEED = INDEX["mission_speed"]


def changed_by(fault):
    return frozenset((*fault.scale, *fault.offset))


def is_pair(fault):
    """Whether it has the same parameters on both sides, and no others."""
    names = changed_by(fault)
    of_port = {name for name in names if name.startswith("port")}
    return names - of_port == {name.replace("port", "starboard", 1) for name in of_port}


@pytest.fixture(scope="module")
def rollouts():
    return list(training_episodes("training", 64, unknown=0.5))


@pytest.fixture(scope="module")
def faults():
    random = np.random.default_rng(0)
    return [random_fault(random) for _ in range(400)]


def test_half_of_every_kind_of_mission_is_real(rollouts):
    assert [rollout.label.shape for rollout in rollouts] == 2 * [(600, 16)] + 4 * [(600, 8)]
    in_steps = []
    for rollout in rollouts:
        rpm = rollout.observations[:, :, INDEX["port_rpm"]]
        in_steps.append(bool((rpm == np.round(rpm)).all()))
    assert in_steps[::2] == [True] * 3


def test_a_third_of_the_other_vehicles_is_ideal_and_a_third_partly():
    drawn = [drawn_realism(seed) for seed in range(600)]
    realism = np.array([one.realism for one in drawn])
    assert 0.28 < np.mean(realism == 0.0) < 0.39
    others = realism[realism > 0.0]
    assert 0.9 < others.mean() < 1.1
    assert others.max() <= LARGEST_REALISM
    partly = [one.imperfections for one in drawn if one.imperfections is not None]
    assert 0.28 < len(partly) / len(drawn) < 0.39
    assert {len(names) for names in partly} == set(range(1, len(EFFECTS)))
    assert {name for names in partly for name in names} == set(EFFECTS)
    assert all(len(set(names)) == len(names) for names in partly)


def test_missions_with_rests_begin_and_end_at_rest_or_have_one_speed():
    course = course_with_rests(range(400))
    rolled = roll_out(Fleet(400), range(400), 600, course.actions, [()] * 400, course.missions)
    command = rolled.observations[1:, :, INDEX["speed_command"]]
    mission = rolled.observations[1:, :, MISSION_SPEED]
    begins_at_rest = (mission[:15] == 0.0).all(axis=0)
    ends_at_rest = (mission[-25:] == 0.0).all(axis=0)
    assert 0.4 < begins_at_rest.mean() < 0.6
    assert 0.4 < ends_at_rest.mean() < 0.6
    np.testing.assert_array_equal(command[:15, begins_at_rest], 0.0)
    np.testing.assert_array_equal(begins_at_rest, course.start > 0.0)
    speeds = [len(set(speed) - {0.0}) for speed in mission.T.tolist()]
    assert 0.5 < np.mean(np.array(speeds) == 1) < 0.7


def test_no_fault_begins_at_rest_before_the_mission():
    events = events_of([(FaultEvent("increased_drag", 5.0, 1.0, end=20.0),), ()])
    moved = later(events, np.array([10.0, 3.0]))
    assert moved.profile[0, 0].tolist() == [15.0, 1.0, 0.0, 30.0, 0.0, 1.0]
    assert moved.profile[1, 0, 0] == np.inf


def test_a_share_of_the_faulty_lanes_is_unknown_to_every_class(rollouts):
    label = np.concatenate([rollout.label for rollout in rollouts], axis=1)
    is_unknown = (label == UNKNOWN).any(axis=0)
    is_faulty = (label > 0).any(axis=0)
    assert 0.3 < is_unknown.sum() / is_faulty.sum() < 0.7
    assert set(np.unique(label[:, is_unknown])) == {0, UNKNOWN}


def test_without_a_share_nothing_is_unknown():
    labels = [rollout.label for rollout in training_episodes("training", 16)]
    assert np.concatenate(labels, axis=1).max() < UNKNOWN


def test_an_unknown_fault_takes_the_place_of_one_and_not_of_health():
    events = ScheduleSampler(healthy=0.5, compound=0.5).sample_events(
        np.arange(64, dtype=np.uint64)
    )
    replaced, faults = with_unknown_faults(events, 1.0, np.random.default_rng(0))
    is_faulty = events.fault[:, 0] >= 0
    assert len(faults) == is_faulty.sum()
    assert (replaced.fault[is_faulty, 0] >= len(plant_faults())).all()
    assert (replaced.fault[~is_faulty] == -1).all()
    assert (replaced.fault[:, 1] == -1).all()
    np.testing.assert_array_equal(replaced.profile[:, 0, 0], events.profile[:, 0, 0])
    assert (replaced.profile[is_faulty, 0, 1] == 1.0).all()
    assert not (events.fault >= len(plant_faults())).any()


def test_a_fleet_applies_its_own_faults():
    random = np.random.default_rng(1)
    events = events_of([(FaultEvent("increased_drag", 0.0, 1.0),)])
    events, faults = with_unknown_faults(events, 1.0, random)
    fleet = Fleet(1, healthy_band=0.0, more_faults=faults)
    observation = fleet.reset([0], schedules=events, missions=[MISSIONS["cruise"]])
    fleet.step(observation[:, :1] * [1.0, 0.0, 0.0])
    assert fleet.diagnoses[fleet.plan.fault[0, 0]] == "unknown"
    effect = matrices(faults)
    healthy = fleet.plan.healthy[0]
    expected = np.clip(healthy * effect.scale[0] + effect.offset[0], effect.low, effect.high)
    rows = slice(layout.PARAMETER, layout.PARAMETER + len(PARAMETERS))
    np.testing.assert_allclose(fleet.table[0, rows, 0], expected)
    assert not np.allclose(expected, healthy)


def test_no_random_fault_is_one_of_the_test(faults):
    tested = [changed_by(fault) for fault in UNMODELLED.values()]
    singles = [fault for fault in faults if not is_pair(fault)]
    assert 0.6 < len(singles) / len(faults) < 0.9
    for fault in singles:
        assert changed_by(fault) not in tested


def test_no_class_explains_a_random_fault(faults):
    of_classes = {}
    for fault in CATALOGUE.values():
        of_classes.setdefault(fault.diagnosis, set()).update(fault.scale, fault.offset)
    for fault in faults:
        assert not any(changed_by(fault) <= names for names in of_classes.values())


def test_random_faults_are_many_and_stand_out(faults):
    assert {fault.diagnosis for fault in faults} == {"unknown"}
    assert len(set(map(changed_by, faults))) > 100
    singles = [fault for fault in faults if not is_pair(fault)]
    factors = np.array([factor for fault in singles for factor in fault.scale.values()])
    assert (np.abs(np.log(factors)) >= np.log(1.249)).all()
    assert 0.45 < factors.min() and factors.max() < 2.01


def test_a_pair_is_the_same_fault_on_both_sides(faults):
    pairs = [fault for fault in faults if is_pair(fault)]
    seals = [fault for fault in pairs if "port_coulomb_friction" in fault.scale]
    for fault in seals:
        severities = [
            (fault.scale[f"{side}_coulomb_friction"] - 1.0) / 2.0 for side in ("port", "starboard")
        ]
        shifts = [fault.offset[f"{side}_viscous_friction"] / 2e-4 for side in ("port", "starboard")]
        np.testing.assert_allclose(severities, shifts)
        assert 0.4 <= min(severities) <= max(severities) <= 1.0
    losses = [fault for fault in pairs if fault.scale.get("port_beta") == 0.0]
    assert seals and losses
    assert all(fault.scale["starboard_beta"] == 0.0 for fault in losses)
