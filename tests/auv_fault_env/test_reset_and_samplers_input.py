"""Bad input to resets and samplers: seeds, options, lanes, distributions; refused before anything
changes.
"""

import math
import re

import numpy as np
import pytest

from auv_fault_env import MISSIONS, Fault, Fleet, MissionSampler, ScheduleSampler
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv
from auv_fault_env.errors import InputError
from auv_fault_env.truth import FleetTruth

LINE = re.compile(r"(?P<thing>.+?): got (?P<got>.+); allowed is (?P<allowed>.+); (?P<remedy>[^;]+)")
NAN = math.nan
INF = math.inf
EVENT = {"fault": "increased_drag", "onset": 1.0, "severity": 0.5}


def assert_refused(call, thing, got, allowed, remedy=".+"):
    """The call raises one line with all four parts; each part is found by a regular expression."""
    with pytest.raises(ValueError) as caught:
        call()
    parts = LINE.fullmatch(str(caught.value))
    assert parts, f"not in the form of a refusal: {str(caught.value)!r}"
    for name, pattern in dict(thing=thing, got=got, allowed=allowed, remedy=remedy).items():
        assert re.search(pattern, parts[name]), f"{name} is {parts[name]!r}, without {pattern!r}"


@pytest.mark.parametrize("lanes", [0, 3], ids=["single", "vector"])
@pytest.mark.parametrize("name", ["schedul", "seed", 1], ids=str)
def test_unknown_reset_option(lanes, name):
    env = PropulsionVectorEnv(lanes, truth="full") if lanes else PropulsionEnv(truth="full")
    assert_refused(
        lambda: env.reset(options={name: []}),
        "reset option",
        re.escape(repr(name)),
        "one of schedule, mission",
    )


@pytest.mark.parametrize("options", [5, "schedule", ["schedule"]], ids=repr)
def test_options_that_are_no_mapping(options):
    assert_refused(
        lambda: PropulsionEnv(truth="full").reset(options=options),
        "options",
        re.escape(repr(options)),
        "mapping",
    )


def test_options_by_lane_belong_to_the_vector_environment():
    assert_refused(
        lambda: PropulsionEnv(truth="full").reset(options={"schedules": [[]]}),
        "reset option",
        "schedules",
        "one of schedule",
    )


SEEDS = {
    "too_few": ([1, 2], "number of seeds", "2", "3, one per lane"),
    "too_many": ([1, 2, 3, 4], "number of seeds", "4", "3, one per lane"),
    "words": (["a", "b", "c"], "seed", "'a'", "whole number"),
    "fractions": ([1.5, 2, 3], "seed", "1.5", "whole number"),
    "nan": ([NAN, 2, 3], "seed", "nan", "whole number"),
    "negative": ([-1, 2, 3], "seed", "-1", "whole number from 0"),
    "fraction": (1.5, "seed", "1.5", "."),
    "digits_as_text": ("123", "seed", "'?123'?", "."),
}


@pytest.mark.parametrize("case", SEEDS.values(), ids=SEEDS)
def test_seeds_of_the_vector_environment(case):
    seed, *expected = case
    assert_refused(lambda: PropulsionVectorEnv(3, truth="full").reset(seed=seed), *expected)


PER_LANE = {
    "schedules_too_few": (
        {"schedules": [[EVENT]]},
        "number of schedules",
        "1",
        "3, one per lane",
        "'schedule'",
    ),
    "schedules_none_given": ({"schedules": []}, "number of schedules", "0", "3, one per lane"),
    "schedules_path": ({"schedules": "x.json"}, "schedules", "x.json", "."),
    "schedules_number": ({"schedules": 5}, "schedules", "5", "."),
    "schedules_flat": (
        {"schedules": [EVENT] * 3},
        "schedule",
        "increased_drag",
        "sequence of events",
        "list",
    ),
    "missions_too_many": (
        {"missions": ["cruise"] * 4},
        "number of missions",
        "4",
        "3, one per lane",
        "'mission'",
    ),
    "missions_name": ({"missions": "cruise"}, "missions", "cruise", "."),
    "both": ({"schedule": [], "schedules": [[]] * 3}, "reset option", "schedule", "either"),
}


@pytest.mark.parametrize("case", PER_LANE.values(), ids=PER_LANE)
def test_options_by_lane(case):
    options, *expected = case
    assert_refused(
        lambda: PropulsionVectorEnv(3, truth="full").reset(seed=1, options=options), *expected
    )


def test_a_refused_reset_leaves_the_episode_as_it_was():
    env = PropulsionVectorEnv(3, truth="full")
    twin = PropulsionVectorEnv(3, truth="full")
    for one in (env, twin):
        one.reset(seed=1)
    for bad in (
        dict(options={"mission": "nowhere"}),
        dict(seed=[1, 2]),
        dict(seed=2, options={"schedule": 5}),
    ):
        with pytest.raises(ValueError, match="got"):
            env.reset(**bad)
    assert env.step(np.zeros((3, 3)))[0].tobytes() == twin.step(np.zeros((3, 3)))[0].tobytes()
    assert env.reset()[0].tobytes() == twin.reset()[0].tobytes()


CRUISE = MISSIONS["cruise"]
FLEETS = {
    "seeds_too_few": (dict(seeds=[1, 2]), "seeds", "2", "3"),
    "seeds_one_for_all": (dict(seeds=[1]), "seeds", "1", "3"),
    "schedules_too_few": (dict(seeds=[1, 2, 3], schedules=[()]), "schedules", "1", "3"),
    "missions_too_few": (dict(seeds=[1, 2, 3], missions=[CRUISE]), "missions", "1", "3"),
    "lane_out_of_range": (dict(seeds=[1], lanes=[3]), "lanes", "3", "0 to 2"),
    "lane_negative": (dict(seeds=[1], lanes=[-1]), "lanes", "-1", "0 to 2"),
    "lane_twice": (dict(seeds=[1, 2], lanes=[1, 1]), "lanes", "1, 1", "."),
    "lanes_as_mask": (dict(seeds=[1], lanes=[True, False, False]), "lanes", "True", "."),
    "observations_too_few": (
        dict(seeds=[1, 2, 3], observations=np.zeros((1, 12), np.float32)),
        "observations",
        "1",
        "3",
    ),
    "observations_columns": (
        dict(seeds=[1, 2, 3], observations=np.zeros((3, 5), np.float32)),
        "observations",
        "5",
        "12",
    ),
    "observations_float64": (
        dict(seeds=[1, 2, 3], observations=np.zeros((3, 12))),
        "observations",
        "float64",
        "float32",
    ),
}


@pytest.mark.parametrize("case", FLEETS.values(), ids=FLEETS)
def test_fleet_never_hands_a_wrong_shape_to_the_kernel(case):
    arguments, *expected = case
    fleet = Fleet(3)
    fleet.reset([1, 2, 3])
    assert_refused(lambda: fleet.reset(**arguments), *expected)


def schedules(**distribution):
    return lambda: ScheduleSampler(**distribution)


def missions(**distribution):
    return lambda: MissionSampler(**distribution)


SAMPLERS = {
    "unknown_class": (
        schedules(prior={"sensor:sped": 1}),
        "class of the prior",
        "sensor:sped",
        "one of",
        "sensor:speed",
    ),
    "fault_instead_of_class": (
        schedules(prior={"sensor_bias:speed": 1}),
        "class of the prior",
        "bias",
        "one of",
    ),
    "negative_weight": (schedules(prior={"sensor:speed": -1}), "sensor:speed", "-1", "0 to"),
    "weight_nan": (schedules(prior={"sensor:speed": NAN}), "sensor:speed", "nan", "0 to"),
    "weight_infinite": (schedules(prior={"sensor:speed": INF}), "sensor:speed", "inf", "0 to"),
    "no_weight_at_all": (schedules(prior={"sensor:speed": 0}), "prior", "0", "."),
    "share_above_one": (schedules(healthy=2), "healthy", "2", "0 to 1"),
    "share_as_text": (schedules(healthy="0.5"), "healthy", "'0.5'", "0 to 1"),
    "severity_above_one": (schedules(severity=(0.0, 2.0)), "severity", "2.0", "0 to 1"),
    "severity_reversed": (schedules(severity=(1.0, 0.2)), "severity", "1.0, 0.2", "."),
    "severity_number": (schedules(severity=0.5), "severity", "0.5", "."),
    "severity_nan": (schedules(severity=(NAN, 1.0)), "severity", "nan", "0 to 1"),
    "severity_triple": (schedules(severity=(0.2, 0.4, 0.6)), "severity", "0.2, 0.4, 0.6", "."),
    "onset_negative": (schedules(onset=(-5.0, 5.0)), "onset", "-5", "0 to"),
    "onset_alone": (schedules(onset=(5.0,)), "onset", "5.0", "."),
    "duty_above_one": (schedules(duty=(0.0, 3.0)), "duty", "3.0", "0 to 1"),
    "period_negative": (schedules(period=(-1.0, 1.0)), "period", "-1", "0 to"),
    "ramp_negative": (schedules(ramp=(-3.0, -1.0)), "ramp", "-3", "0 to"),
    "life_negative": (schedules(life=(-5.0, 1.0)), "life", "-5", "."),
    "mission_too_fast": (missions(speed=(2.0, 3.0)), "speed", "2.0|3.0", "0 to 1"),
    "mission_speed_nan": (missions(speed=(NAN, 1.0)), "speed", "nan", "0 to 1"),
    "mission_speed_number": (missions(speed=0.3), "speed", "0.3", "."),
    "mission_without_legs": (missions(n_legs=0), "legs", "0", "a whole number from 1"),
    "mission_legs_fraction": (missions(n_legs=2.5), "legs", "2.5", "a whole number from 1"),
    "mission_legs_of_no_length": (missions(duration=(0.0, 0.0)), "duration", "0.0", "."),
    "mission_share": (missions(from_rest=2), "from_rest", "2", "0 to 1"),
}


@pytest.mark.parametrize("case", SAMPLERS.values(), ids=SAMPLERS)
def test_distributions_are_checked_when_they_are_declared(case):
    assert_refused(*case)


@pytest.mark.parametrize("seed", [-1, 1.5, "a"], ids=repr)
def test_seed_of_a_sample(seed):
    assert_refused(
        lambda: ScheduleSampler().sample(seed),
        "seed",
        re.escape(repr(seed)),
        "a whole number from 0",
    )


FAULTS = {
    "unknown_parameter": (
        {"scale": {"alpa": 2.0}},
        "parameter of fault icing",
        "'alpa'",
        "one of alpha",
        "'alpha'",
    ),
    "scale_nan": ({"scale": {"alpha": NAN}}, "icing", "nan", "."),
    "scale_negative": ({"scale": {"alpha": -2.0}}, "icing", "-2", "0 to"),
    "scale_text": ({"scale": {"alpha": "2"}}, "icing", "'2'", "."),
    "offset_infinite": ({"offset": {"alpha": -INF}}, "icing", "-inf", "."),
}


@pytest.mark.parametrize("case", FAULTS.values(), ids=FAULTS)
def test_faults(case):
    fields, *expected = case
    assert_refused(lambda: Fault("icing", "hull", **fields), *expected)


def test_unknown_key_of_the_truth():
    fleet = Fleet(2)
    fleet.reset([1, 2])
    call = lambda: FleetTruth(fleet)["labl"]  # noqa: E731
    assert_refused(call, "truth", "labl", "one of label, severity", "'label'")


@pytest.mark.parametrize("level", ["labels", True, None, 0, 1, ["full"]], ids=repr)
@pytest.mark.parametrize("maker", [PropulsionEnv, PropulsionVectorEnv])
def test_level_of_the_truth(maker, level):
    expected = "truth", re.escape(repr(level)), "'full', 'label' or False", "give one"
    assert_refused(lambda: maker(truth=level), *expected)


def test_fleet_needs_a_reset_of_all_lanes_first():
    fleet = Fleet(2)
    with pytest.raises(InputError, match="step: got 'no reset before'"):
        fleet.step(np.zeros((2, 3)))
    with pytest.raises(InputError, match="all lanes, at the first reset"):
        fleet.reset(seeds=[1], lanes=[0])


@pytest.mark.parametrize(
    "values", [np.ones((2, 3)), np.full((2, 58), np.nan)], ids=["shape", "nan"]
)
def test_healthy_parameters_are_checked(values):
    fleet = Fleet(2)
    fleet.reset(seeds=[1, 2])
    with pytest.raises(InputError, match="healthy parameters"):
        fleet.set_healthy(values)


def test_refused_reset_leaves_the_fleet_as_it_was():
    fleet = Fleet(2)
    fleet.reset(seeds=[1, 2])
    before = fleet.table.copy()
    with pytest.raises(InputError):
        fleet.reset(seeds=[3, 4], schedules=[(), [{"fault": "nothing"}]])
    assert np.array_equal(before, fleet.table)
    assert fleet.plan.severity.shape == (2, 2)
