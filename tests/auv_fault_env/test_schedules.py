"""When faults come and go: profiles against a plain reckoning in fractions, labels, JSON."""

import json
import math
from fractions import Fraction

import numpy as np
import pytest

from auv_fault_env import CATALOGUE, FaultEvent, Fleet, from_json, load_schedule, to_json
from auv_fault_env.env import PropulsionEnv
from auv_fault_env.episodes import UPDATE_NOW, severities_over_time
from auv_fault_env.schedules import Events, schedule_of

DRAG = "increased_drag"


def event(fault=DRAG, onset=1.0, severity=0.8, **profile):
    return FaultEvent(fault, onset, severity, **profile)


def truths(*events, steps, **options):
    """The truth of every step of an episode without noise."""
    env = PropulsionEnv(truth="full", sensor_noise=0.0, disturbance=0.0, healthy_band=0.0)
    env.reset(seed=1, options={"schedule": events, "mission": "cruise"} | options)
    return [env.step([0.3, 0.0, 0.0])[4]["truth"] for _ in range(steps)]


def expected_severity(step, onset, severity, ramp, end, period, duty):
    """The documented severity profile at the start of a step, with exact decimal times."""
    time, onset, ramp, period, duty = (
        Fraction(str(x)) for x in (step / 10, onset, ramp, period, duty)
    )
    since = time - onset
    ended = end < math.inf and time >= Fraction(str(end))
    if since < 0 or ended or (period and since % period >= duty * period and duty < 1):
        return 0.0
    return severity * float(min(since / ramp, 1)) if ramp else severity


PROFILES = {
    "abrupt": event(),
    "at_the_start": event(onset=0.0),
    "onset_0.3": event(onset=0.3),
    "onset_0.7": event(onset=0.7),
    "onset_12.3": event(onset=12.3),
    "onset_within_a_sample": event(onset=1.23),
    "onset_just_after_a_sample": event(onset=0.7000001),
    "ramp": event(ramp=2.0),
    "ramp_0.7_from_0.3": event(onset=0.3, ramp=0.7),
    "ramp_shorter_than_a_sample": event(ramp=0.05),
    "repaired": event(end=2.3),
    "repaired_within_a_sample": event(end=2.34),
    "repaired_before_the_ramp_is_over": event(ramp=4.0, end=3.0),
    "intermittent": event(period=2.0, duty=0.5),
    "intermittent_0.7_of_0.3": event(onset=0.3, period=0.7, duty=0.3),
    "intermittent_duty_0.1": event(period=3.0, duty=0.1),
    "intermittent_always_on": event(period=2.0, duty=1.0),
    "intermittent_never_on": event(period=2.0, duty=0.0),
    "all_together": event(onset=0.7, ramp=3.0, end=11.1, period=2.3, duty=0.6),
}


@pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)
def test_severity_in_force_follows_the_profile(profile):
    fields = [
        getattr(profile, name) for name in ("onset", "severity", "ramp", "end", "period", "duty")
    ]
    got = [truth["severity"][DRAG] for truth in truths(profile, steps=150)]
    assert got == pytest.approx(
        [expected_severity(step, *fields) for step in range(150)], abs=1e-12
    )


@pytest.mark.parametrize("onset", [0.0, 0.1, 0.3, 0.7, 1.1, 2.3, 4.7, 8.2, 12.3])
def test_fault_is_in_force_from_the_first_step_that_starts_at_the_onset(onset):
    first = round(10 * onset)
    labels = [truth["label"] for truth in truths(event(onset=onset), steps=first + 3)]
    assert labels == ["normal"] * first + [DRAG] * 3


def test_intermittent_fault_is_present_for_its_share_of_the_period():
    labels = [truth["label"] for truth in truths(event(onset=1.0, period=2.0, duty=0.3), steps=50)]
    assert labels == (["normal"] * 10 + ([DRAG] * 6 + ["normal"] * 14) * 2)


def test_parameters_return_to_healthy_when_repaired():
    alpha = [
        truth["parameters"]["alpha"]
        for truth in truths(event(onset=0.5, severity=1.0, end=1.0), steps=15)
    ]
    assert alpha == [alpha[0]] * 5 + [2.0 * alpha[0]] * 5 + [alpha[0]] * 5


def test_compound_faults_compose_by_product_and_sum():
    events = [
        event(DRAG, 0.0, 0.4),
        event("decreased_drag", 0.0, 0.5),
        event("sensor_bias:speed", 0.0, 0.25),
        event("sensor_bias:speed", 0.0, 0.5),
        event("propeller_damage:port", 0.0, 1.0),
        event("propeller_damage:port", 0.0, 0.5),
    ]
    healthy = truths(steps=1)[0]["parameters"]
    broken = truths(*events, steps=1)[0]["parameters"]
    assert broken["alpha"] == pytest.approx(
        healthy["alpha"] * (1 + 0.4) * (1 - 0.5 * 0.5), rel=1e-14
    )
    assert broken["gamma"] == pytest.approx(healthy["gamma"] * (1 - 0.5 * 0.5), rel=1e-14)
    assert broken["port_beta"] == pytest.approx(healthy["port_beta"] * 0.5 * 0.75, rel=1e-14)
    assert broken["speed_bias"] == pytest.approx(0.75 * 0.15, rel=1e-14)
    moved = {"alpha", "gamma", "port_beta", "port_c1", "port_c2", "speed_bias"}
    assert {name for name in healthy if healthy[name] != broken[name]} == moved


def test_label_is_the_class_of_the_largest_severity_in_force():
    weak = event(onset=0.1, severity=0.3)
    strong = event("sensor_bias:speed", 0.3, 0.6, end=0.5)
    got = truths(weak, strong, steps=7)
    assert [truth["label"] for truth in got] == ["normal"] + [DRAG] * 2 + ["sensor:speed"] * 2 + [
        DRAG
    ] * 2
    assert got[3]["severity"][DRAG] == 0.3 and got[3]["severity"]["sensor:speed"] == 0.6
    assert {truth["onset"] for truth in got} == {0.1}


def test_severity_of_a_class_is_the_largest_of_its_kinds():
    got = truths(
        event("sensor_bias:speed", 0.0, 0.3), event("sensor_scale:speed", 0.0, 0.7), steps=1
    )[0]
    assert got["severity"]["sensor:speed"] == 0.7 and sum(got["severity"].values()) == 0.7


@pytest.mark.parametrize("seed", range(3))
def test_severities_change_at_every_step_at_which_their_profiles_do(seed):
    """The fleet computes severities at the steps alone that it has foreseen."""
    n_lanes = 300
    rng = np.random.default_rng(seed)
    tenths = rng.integers(0, 2, n_lanes).astype(bool)
    period = rng.choice([0.05, 0.1, 0.3, 0.7, 2.3], n_lanes)
    profile = np.stack(
        [
            np.where(tenths, rng.integers(0, 50, n_lanes) / 10, rng.uniform(0.0, 5.0, n_lanes)),
            rng.uniform(0.1, 1.0, n_lanes),
            rng.choice([0.0, 0.0, 0.7, 1.03], n_lanes),
            rng.choice([np.inf, 6.0, 7.77], n_lanes),
            np.where(rng.random(n_lanes) < 0.7, period, 0.0),
            rng.choice([0.0, 0.1, 0.3, 1 / 3, 0.5, 0.99, 1.0], n_lanes),
        ],
        axis=-1,
    )[:, None]
    fleet = Fleet(n_lanes)
    events = Events(np.zeros((n_lanes, 1), np.int64), profile)
    fleet.reset(range(n_lanes), schedules=events)
    expected = severities_over_time(np.arange(100) / 10, profile)
    updates = 0
    for step in range(100):
        updates += int((fleet.state.step >= fleet.state.next_update).sum())
        fleet.step(np.zeros((n_lanes, 3)))
        np.testing.assert_allclose(fleet.plan.severity[:, 0], expected[step], atol=1e-15)
    assert updates < 0.5 * 100 * n_lanes


def test_parameters_are_those_of_a_fleet_that_computes_all_of_them_at_every_step():
    kept = Fleet(64, realism=1.0)
    renewed = Fleet(64, realism=1.0)
    action = np.full((64, 3), 0.2)
    for fleet in (kept, renewed):
        fleet.reset(range(64))
    for _ in range(400):
        renewed.state.next_update[:] = UPDATE_NOW
        renewed._n_due = 64
        assert kept.step(action).tobytes() == renewed.step(action).tobytes()
    np.testing.assert_array_equal(kept.state.memory, renewed.state.memory)


def test_more_events_than_the_sampler_draws():
    events = [event(name, 0.0, 0.5) for name in CATALOGUE]
    got = truths(*events, steps=2)[1]
    assert got["severity"].pop("unknown") == 0.0
    assert set(got["severity"].values()) == {0.5}
    assert all(math.isfinite(value) for value in got["state"].values())


def test_schedules_may_shrink_between_episodes():
    env = PropulsionEnv(truth="full")
    env.reset(seed=1, options={"schedule": [event(name, 0.0) for name in CATALOGUE]})
    first, _ = env.reset(seed=2, options={"schedule": []})
    again, _ = PropulsionEnv(truth="full").reset(seed=2, options={"schedule": []})
    assert first.tobytes() == again.tobytes()
    assert env.step([0.3, 0, 0])[4]["truth"]["label"] == "normal"


@pytest.mark.parametrize("form", ["events", "mappings", "tuple", "json_path", "json_string_path"])
def test_every_form_of_a_schedule_means_the_same(form, tmp_path):
    plain = [
        {"fault": DRAG, "onset": 0.5, "severity": 0.25},
        {"fault": "sensor_stuck:speed", "onset": 1, "severity": 1},
    ]
    events = tuple(FaultEvent(**fields) for fields in plain)
    path = tmp_path / "schedule.json"
    path.write_text(json.dumps(plain))
    forms = dict(
        events=list(events),
        mappings=plain,
        tuple=events,
        json_path=path,
        json_string_path=str(path),
    )
    assert schedule_of(forms[form]) == events
    got = truths(steps=12, schedule=forms[form])
    assert (
        got[4]["label"] == "normal"
        and got[5]["label"] == DRAG
        and got[10]["label"] == "sensor:speed"
    )


def test_json_leaves_defaults_out_and_keeps_the_rest():
    text = to_json(
        (event(), event("propeller_loss:port", 0.3, 1.0, ramp=1.5, end=9.0, period=2.0, duty=0.25))
    )
    assert json.loads(text) == [
        {"fault": DRAG, "onset": 1.0, "severity": 0.8},
        dict(
            fault="propeller_loss:port",
            onset=0.3,
            severity=1.0,
            ramp=1.5,
            end=9.0,
            period=2.0,
            duty=0.25,
        ),
    ]


@pytest.mark.parametrize("seed", range(20))
def test_json_round_trip_of_random_events_is_exact(seed, tmp_path):
    random = np.random.default_rng(seed)
    names = random.choice(list(CATALOGUE), 4).tolist()
    draw = lambda: random.uniform(0.0, 1.0)  # noqa: E731
    events = tuple(
        event(name, draw(), draw(), ramp=draw(), end=2 + draw(), period=draw(), duty=draw())
        for name in names
    )
    (tmp_path / "schedule.json").write_text(to_json(events))
    assert from_json(to_json(events)) == events == load_schedule(tmp_path / "schedule.json")


def test_empty_schedule_round_trips():
    assert from_json(to_json(())) == ()


def test_events_take_numpy_numbers_and_keep_plain_ones():
    got = FaultEvent(DRAG, np.float32(0.5), np.int64(1), ramp=np.float64(2.0))
    assert (got.onset, got.severity, got.ramp) == (0.5, 1.0, 2.0)
    assert {type(value) for value in (got.onset, got.severity, got.ramp, got.end)} == {float}
    assert from_json(to_json((got,))) == (got,)
