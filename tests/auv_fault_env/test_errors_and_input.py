"""Bad input is refused in one line that names the thing, the value got, what is allowed and the
remedy.
"""

import dataclasses
import math
import re
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from auv_fault_env import PRESETS, FaultEvent, Fleet, Mission, from_json, load_schedule
from auv_fault_env.env import PropulsionEnv, PropulsionVectorEnv

LINE = re.compile(r"(?P<thing>.+?): got (?P<got>.+); allowed is (?P<allowed>.+); (?P<remedy>[^;]+)")
NAN = math.nan
INF = math.inf
EVENT = {"fault": "increased_drag", "onset": 1.0, "severity": 0.5}
FRACTION = r"0 to 1$"
POSITIVE = r"a whole number from 1$"


def assert_refused(call, thing, got, allowed, remedy=".+", kind=ValueError):
    """The call raises one line with all four parts; each part is found by a regular expression."""
    with pytest.raises(kind) as caught:
        call()
    text = str(caught.value)
    parts = LINE.fullmatch(text)
    assert parts, f"not in the form of a refusal: {text!r}"
    for name, pattern in dict(thing=thing, got=got, allowed=allowed, remedy=remedy).items():
        assert re.search(pattern, parts[name]), f"{name} is {parts[name]!r}, without {pattern!r}"
    assert len(text) < 2000


def cases(table):
    return pytest.mark.parametrize("case", table.values(), ids=table)


def event(**changes):
    return lambda: FaultEvent(**EVENT | changes)


def single(**options):
    return lambda: PropulsionEnv(truth="full").reset(seed=1, options=options)


def vector(**options):
    return lambda: PropulsionVectorEnv(3, truth="full").reset(seed=1, options=options)


EVENTS = {
    "unknown_fault": (
        event(fault="propeler_loss:port"),
        "fault",
        "propeler",
        "propeller_loss:port",
        "did you mean",
    ),
    "fault_far_from_any": (
        event(fault="zzzzzz"),
        "fault",
        "zzzzzz",
        "one of .*increased_drag",
        "list",
    ),
    "fault_none": (event(fault=None), "fault", "None", "one of increased_drag", "list"),
    "fault_array": (
        event(fault=np.array(["increased_drag"] * 2)),
        "fault",
        "array",
        "one of",
        "list",
    ),
    "severity_above_one": (event(severity=1.01), "severity of increased_drag", "1.01", FRACTION),
    "severity_in_percent": (event(severity=50), "severity", "50", FRACTION),
    "severity_negative": (event(severity=-0.1), "severity", "-0.1", FRACTION),
    "severity_nan": (event(severity=NAN), "severity", "nan", FRACTION),
    "severity_none": (event(severity=None), "severity", "None", FRACTION),
    "severity_word": (event(severity="high"), "severity", "'high'", FRACTION),
    "severity_digits_as_text": (event(severity="0.5"), "severity", "'0.5'", FRACTION),
    "severity_bool": (event(severity=True), "severity", "True", FRACTION),
    "severity_bytes": (event(severity=b"0.5"), "severity", "b'0.5'", FRACTION),
    "severity_array": (event(severity=np.array([0.1, 0.2])), "severity", "array", FRACTION),
    "severity_matrix": (event(severity=np.zeros((99, 99))), "severity", "array", FRACTION),
    "severity_huge_integer": (event(severity=10**400), "severity", "1000", FRACTION),
    "onset_negative": (event(onset=-1), "onset of increased_drag", "-1", "0 to 1e"),
    "onset_nan": (event(onset=NAN), "onset", "nan", "0 to 1e"),
    "onset_infinite": (event(onset=INF), "onset", "inf", "0 to 1e"),
    "onset_after_its_end": (
        event(onset=5, end=3),
        "onset of increased_drag",
        "5.0",
        "before its end at 3 s",
    ),
    "onset_at_its_end": (
        event(onset=3, end=3),
        "onset of increased_drag",
        "3.0",
        "before its end at 3 s",
    ),
    "ramp_negative": (event(ramp=-1), "ramp of", "-1", "0 to 1e"),
    "end_null": (event(end=None), "end of", "None", "0 to inf"),
    "period_nan": (event(period=NAN), "period of", "nan", "0 to 1e"),
    "duty_above_one": (event(duty=1.5), "duty of", "1.5", FRACTION),
}


@cases(EVENTS)
def test_fault_events(case):
    assert_refused(*case)


LATE = EVENT | {"onset": 60.0}
SCHEDULES = {
    "mapping": (EVENT, "^schedule", "increased_drag", "sequence of events or a path", "list"),
    "number": (5, "^schedule", "5", "sequence of events or a path"),
    "false": (False, "^schedule", "False", "sequence of events or a path"),
    "generator": ((x for x in [EVENT]), "^schedule", "generator", "sequence of events or a path"),
    "array": (np.array([EVENT]), "^schedule", "array", "sequence of events or a path"),
    "bytes": (b"schedule.json", "^schedule", "b'schedule.json'", "sequence of events or a path"),
    "list_of_names": (
        ["increased_drag"],
        "event of a schedule",
        "increased_drag",
        "mapping with fault, onset, severity",
    ),
    "tuple_event": ([("increased_drag", 1, 1)], "event of a schedule", "increased_drag", "mapping"),
    "list_of_none": ([None], "event of a schedule", "None", "mapping"),
    "nested": ([[EVENT]], "event of a schedule", "increased_drag", "mapping"),
    "unknown_field": (
        [EVENT | {"sevrity": 1}],
        "field of a fault event",
        "'sevrity'",
        "one of fault, onset",
        "'severity'",
    ),
    "field_number": ([{1: 2}], "field of a fault event", "1", "one of fault, onset"),
    "missing_field": (
        [{"fault": "increased_drag", "onset": 1}],
        "fault event",
        "increased_drag",
        "given",
        "'severity'",
    ),
    "name_instead_of_path": (
        "increased_drag",
        "schedule file",
        "'increased_drag'",
        "a readable JSON file",
    ),
    "empty_path": ("", "schedule file", "''", "a readable JSON file"),
    "bad_severity": ([EVENT | {"severity": 2}], "severity of increased_drag", "2", FRACTION),
}


@cases(SCHEDULES)
@pytest.mark.parametrize("environment", [single, vector])
def test_schedules(case, environment):
    schedule, *expected = case
    assert_refused(environment(schedule=schedule), *expected)


@pytest.mark.parametrize("onset", [60.0, 61, 1e9])
@pytest.mark.parametrize("form", ["vector", "vector_by_lane", "make_vec"])
def test_onset_after_the_end_of_the_episode(onset, form):
    late = [EVENT | {"onset": onset}]
    name = "auv_fault_env/Propulsion-v0"
    calls = {
        "vector": vector(schedule=late),
        "vector_by_lane": vector(schedules=[[], late, []]),
        "make_vec": lambda: gym.make_vec(name, num_envs=2).reset(options={"schedule": late}),
    }
    assert_refused(
        calls[form],
        "onset of increased_drag",
        f"{float(onset)}",
        "before the episode's end at 60 s",
        "raise",
    )


def test_a_longer_episode_takes_a_later_onset():
    longer = PropulsionVectorEnv(2, max_episode_steps=700, truth="full")
    assert longer.reset(options={"schedule": [LATE]})[1]["truth"]["onset"].tolist() == [60.0, 60.0]


def test_one_environment_does_not_know_its_time_limit_and_takes_any_onset():
    for limit in (5, 700):
        env = gym.make("auv_fault_env/Propulsion-v0", max_episode_steps=limit, truth="full")
        assert env.reset(options={"schedule": [LATE]})[1]["truth"]["onset"] == 60.0


BROKEN = {
    "missing_comma": (
        '[\n {"fault": "increased_drag" "onset": 1}\n]',
        r"line 2 column 29",
        "delimiter",
    ),
    "empty": ("", r"line 1 column 1", "Expecting value"),
    "trailing_text": ("[] x", r"line 1 column 4", "Extra data"),
    "single_quotes": ("[{'fault': 1}]", r"line 1 column 3", "double quotes"),
    "object": ("{}", "^schedule$", "dict"),
    "text": ('"increased_drag"', "^schedule$", "str"),
    "null": ("null", "^schedule$", "NoneType"),
    "too_deep": ("[" * 100_000, "^schedule", "."),
    "endless_number": (
        f'[{{"fault": "increased_drag", "onset": 1{"0" * 5000}, "severity": 1}}]',
        "^schedule",
        ".",
    ),
}


@cases(BROKEN)
def test_broken_json(case):
    text, thing, got = case
    assert_refused(lambda: from_json(text), thing, got, "a JSON list of fault events")


def test_broken_json_file_names_the_file_and_the_place(tmp_path):
    path = tmp_path / "broken.json"
    path.write_text('[\n\n  {"fault"}]')
    assert_refused(
        lambda: load_schedule(path),
        r"broken\.json, line 3 column 11",
        "delimiter",
        "a JSON list",
        "correct",
    )


@pytest.mark.parametrize(
    "kind",
    ["missing", "directory", "binary", "utf16", "name_too_long", "null_in_the_name", "newline"],
)
def test_unreadable_files(kind, tmp_path):
    path = tmp_path / "schedule.json"
    contents = {"binary": bytes(range(256)), "utf16": "[]".encode("utf-16")}
    if kind in contents:
        path.write_bytes(contents[kind])
    names = dict(
        directory=tmp_path, name_too_long="x" * 300, null_in_the_name="a\0b", newline="a\nb.json"
    )
    name = str(names.get(kind, path))
    remedies = dict(
        directory="name a regular file", binary="save it as UTF-8", utf16="save it as UTF-8"
    )
    assert_refused(
        single(schedule=name),
        "schedule file",
        re.escape(repr(name)[:100]),
        "a readable JSON file",
        remedies.get(kind, "check the path"),
    )


def test_missing_file_given_as_a_path():
    assert_refused(
        single(schedule=Path("no") / "where.json"),
        "schedule file",
        "where.json",
        "a readable JSON file",
    )


def legs(*pairs):
    return list(pairs)


SPEED = "0 to 1$"  # of the vehicle
ANY_SPEED = "0 to 20$"  # of any vehicle
FORM = r"a name, a speed or a list of \(start, speed\)"
MISSIONS = {
    "unknown": (
        "crusie",
        "^mission$",
        "'crusie'",
        "one of thesis, acceleration, cruise",
        "did you mean 'cruise'",
    ),
    "number_as_text": ("0.3", "^mission$", "'0.3'", "one of thesis"),
    "negative": (-0.1, "mission speed", "-0.1", ANY_SPEED),
    "in_knots": (2.0, "mission speed", "2.0", SPEED),
    "later_leg_in_knots": (legs((0, 0.3), (5, 2.0)), "mission speed", "2.0", SPEED),
    "start_in_knots": ({"legs": [(0, 0.3)], "start_speed": 2.0}, "mission speed", "2.0", SPEED),
    "nan": (NAN, "mission speed", "nan", ANY_SPEED),
    "bool": (True, "mission", "True", "."),
    "unordered": (
        legs((0, 0.3), (5, 0.2), (3, 0.1)),
        "mission legs",
        r"5.0, 3.0",
        "begin at 0 and ascend",
    ),
    "repeated_start": (
        legs((0, 0.3), (0, 0.2)),
        "mission legs",
        r"0.0, 0.0",
        "begin at 0 and ascend",
    ),
    "late_start": (legs((1, 0.3)), "mission legs", r"1.0", "begin at 0 and ascend"),
    "negative_start": (legs((-1, 0.3), (0, 0.3)), "start of a mission leg", "-1", "0 to 1e"),
    "empty": ([], "mission legs", r"\[\]", "begin at 0 and ascend"),
    "flat": ([0, 0.3], "mission", r"\[0, 0.3\]", FORM),
    "triples": (legs((0, 0.3, 1)), "mission", r"\(0, 0.3, 1\)", FORM),
    "words": (legs(("now", "fast")), "mission|start", "now", "."),
    "bytes": (b"cruise", "mission", "b'cruise'", FORM),
    "leg_mappings": ([{"start": 0, "speed": 0.3}], "mission", "start", "."),
    "unknown_field": ({"leg": [(0, 0.3)]}, "mission", "leg", "."),
    "object": (object(), "mission", "object", FORM),
    "huge_integer": (legs((0, 10**400)), "mission", "1000", "."),
}


@cases(MISSIONS)
def test_missions(case):
    mission, *expected = case
    assert_refused(single(mission=mission), *expected)
    assert_refused(vector(missions=[0.3, mission, 0.3]), *expected)


def test_mission_start_speed():
    assert_refused(lambda: Mission(((0.0, 0.3),), start_speed=NAN), "speed", "nan", ANY_SPEED)


ACTIONS = {
    "nan": ([0.3, NAN, 0.0], "action, rudder", "nan", "finite"),
    "infinite": ([0.3, 0.0, -INF], "action, stern_plane", "-inf", "finite"),
    "both_infinities": ([INF, -INF, 0.0], "action, speed_command", "inf", "finite"),
    "too_short": (
        [0.3, 0.0],
        "shape of the action",
        r"2[,)]",
        "3",
        "speed_command, rudder, stern_plane",
    ),
    "nested": ([[[0.3, 0.0, 0.0]]], "shape of the action", r"1, 3\)", "3"),
    "number": (0.3, "shape of the action", r"\(", "3"),
    "none": (None, "action", ".", "."),
    "words": (["a", "b", "c"], "action", "'a'", "."),
    "mapping": ({"speed": 1.0}, "action", "speed", "."),
    "ragged": ([[1], [1, 2], 3], "action", ".", "."),
    "complex": ([1j, 0, 0], "action", "1j", "."),
}


@cases(ACTIONS)
@pytest.mark.parametrize("lanes", [0, 3], ids=["single", "vector"])
def test_actions(case, lanes):
    action, *expected = case
    env = PropulsionVectorEnv(lanes, truth="full") if lanes else PropulsionEnv(truth="full")
    env.reset(seed=1)
    if lanes and isinstance(action, list) and action:
        action = [action] * lanes
    assert_refused(lambda: env.step(action), *expected)


def test_a_refused_action_leaves_the_episode_as_it_was():
    env = PropulsionEnv(truth="full")
    twin = PropulsionEnv(truth="full")
    for one in (env, twin):
        one.reset(seed=1)
    with pytest.raises(ValueError, match="action"):
        env.step([NAN, 0.0, 0.0])
    assert env.step([0.3, 0.0, 0.0])[0].tobytes() == twin.step([0.3, 0.0, 0.0])[0].tobytes()


@pytest.mark.parametrize(
    "shape", [(1, 3), (2, 3), (4, 3), (3,), (9,), (3, 2), (3, 5), (0, 3)], ids=str
)
@pytest.mark.parametrize("maker", [PropulsionVectorEnv, Fleet])
def test_actions_of_a_wrong_shape_never_reach_the_kernel(maker, shape):
    one = maker(3)
    one.reset(seed=1) if maker is PropulsionVectorEnv else one.reset([1, 2, 3])
    assert_refused(
        lambda: one.step(np.zeros(shape)), "shape of the action", re.escape(str(shape)), r"\(3, 3\)"
    )


def test_a_fourth_action_is_refused_by_an_environment_without_it():
    env = PropulsionVectorEnv(3)
    env.reset(seed=1)
    assert_refused(
        lambda: env.step(np.zeros((3, 4))), "shape of the action", r"\(3, 4\)", r"\(3, 3\)"
    )


@pytest.mark.parametrize(
    "maker", [PropulsionEnv, lambda: PropulsionVectorEnv(2, truth="full")], ids=["single", "vector"]
)
def test_step_before_reset(maker):
    call = lambda: maker().step(np.zeros(3))  # noqa: E731
    assert_refused(
        call, "step", "no reset", "after a reset", r"reset\(\)", kind=gym.error.ResetNeeded
    )


@pytest.mark.parametrize("maker", [PropulsionEnv, partial(PropulsionVectorEnv, 2)])
def test_render_before_reset(maker):
    env = maker(render_mode="rgb_array")
    assert_refused(env.render, "render", "no reset", "after a reset", kind=gym.error.ResetNeeded)


def factor(**changes):
    return lambda: PropulsionEnv(truth="full", **changes)


def vehicle(**changes):
    return lambda: dataclasses.replace(PRESETS["thesis1992"], **changes)


ARGUMENTS = {
    "unknown_preset": (
        factor(preset="thesis1993"),
        "preset",
        "thesis1993",
        "one of thesis1992, npsnet1995",
        "thesis1992",
    ),
    "preset_none": (factor(preset=None), "preset", "None", "one of thesis1992"),
    "negative_noise": (factor(sensor_noise=-1), "sensor_noise", "-1", "0 to 10"),
    "noise_nan": (factor(sensor_noise=NAN), "sensor_noise", "nan", "0 to 10"),
    "noise_none": (factor(sensor_noise=None), "sensor_noise", "None", "0 to 10"),
    "noise_text": (factor(sensor_noise="1"), "sensor_noise", "'1'", "0 to 10"),
    "disturbance_text": (factor(disturbance="1"), "disturbance", "'1'", "0 to 10"),
    "band_text": (factor(healthy_band="1"), "healthy_band", "'1'", "0 to 10"),
    "band_in_percent": (factor(healthy_band=100), "healthy_band", "100", "0 to 10"),
    "render_mode": (
        factor(render_mode="humann"),
        "render_mode",
        "humann",
        "one of rgb_array, human",
        "human",
    ),
    "positive_alpha": (vehicle(alpha=0.1), "alpha", "0.1", "-10 to -0.0001"),
    "alpha_nan": (vehicle(alpha=NAN), "alpha", "nan", "-10 to"),
    "alpha_text": (vehicle(alpha="-0.1"), "alpha", "'-0.1'", "-10 to"),
    "no_inertia": (vehicle(inertia=0.0), "inertia", "0.0", "1e-06 to"),
    "beta_infinite": (vehicle(beta=INF), "beta", "inf", "0 to"),
}


@cases(ARGUMENTS)
def test_arguments(case):
    assert_refused(*case)


@pytest.mark.parametrize("number", [0, -1, 1.5, 3.0, True, "3", None, [3], NAN], ids=repr)
@pytest.mark.parametrize("maker", [PropulsionVectorEnv, Fleet])
def test_number_of_lanes(maker, number):
    assert_refused(lambda: maker(number), "number of lanes", re.escape(repr(number)), POSITIVE)


@pytest.mark.parametrize("limit", [0, -1, 1.5, None, "600", True, NAN], ids=repr)
def test_length_of_the_episode(limit):
    call = lambda: PropulsionVectorEnv(2, max_episode_steps=limit, truth="full")  # noqa: E731
    assert_refused(call, "max_episode_steps", re.escape(repr(limit)), POSITIVE)
