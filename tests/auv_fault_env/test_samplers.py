"""What the samplers draw, against the declared distributions, in bands that an honest sampler
leaves once in 10^4.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from auv_fault_env import CATALOGUE, Fleet, MissionSampler, ScheduleSampler, classes
from auv_fault_env.env import PropulsionVectorEnv
from auv_fault_env.noise import episode_keys
from auv_fault_env.schedules import from_json, profile_of, to_json

N_LANES = 20_000
LOSSES = [row for row, name in enumerate(CATALOGUE) if name.startswith("propeller_loss")]
RISK = 1e-4
KEY = episode_keys(np.arange(N_LANES, dtype=np.uint64), np.zeros(N_LANES, np.uint64))


def drawn(**distribution):
    """Catalogue rows (n_lanes, 2), -1 for none, and the profile's columns by name (n_lanes, 2)."""
    events = ScheduleSampler(**distribution).sample_events(KEY)
    return events.fault, profile_of(events)._asdict()


def assert_share(hits, share):
    assert stats.binomtest(int(hits.sum()), hits.size, share).pvalue > RISK


def assert_uniform(values, low, high):
    assert low <= values.min() and values.max() <= high
    assert stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > RISK


@pytest.mark.parametrize("healthy", [0.0, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("compound", [0.0, 0.1, 1.0])
def test_healthy_and_compound_shares(healthy, compound):
    fault, profile = drawn(healthy=healthy, compound=compound)
    present = fault >= 0
    assert_share(~present[:, 0], healthy)
    assert not (present[:, 1] & ~present[:, 0]).any()
    if healthy < 1.0:
        assert_share(present[present[:, 0], 1], compound)
    assert (
        np.isinf(profile["onset"][~present]).all() and (profile["severity"][~present] == 0.0).all()
    )


def diagnoses(fault):
    names = np.array([entry.diagnosis for entry in CATALOGUE.values()])
    return names[fault[fault >= 0]]


PRIORS = {
    "equal": {},
    "one_class": {"propeller_loss:port": 3.0},
    "weighted": {"increased_drag": 1.0, "sensor:speed": 2.0, "seal_friction:port": 5.0},
    "a_class_without_weight": {"increased_drag": 1.0, "decreased_drag": 0.0},
}


@pytest.mark.parametrize("prior", PRIORS.values(), ids=PRIORS)
def test_classes_follow_the_prior(prior):
    fault, _ = drawn(prior=prior, healthy=0.0, compound=0.0)
    got = diagnoses(fault)
    weights = prior or dict.fromkeys(classes()[1:-1], 1.0)
    weights = {
        name: weight / sum(weights.values()) for name, weight in weights.items() if weight > 0.0
    }
    assert set(got) == set(weights)
    for name, weight in weights.items():
        assert_share(got == name, weight)


def test_kinds_within_a_class_are_equally_likely():
    fault, _ = drawn(prior={"sensor:port_rpm": 1.0}, healthy=0.0)
    _, counts = np.unique(fault[fault >= 0], return_counts=True)
    assert counts.size == 5 and stats.chisquare(counts).pvalue > RISK


@pytest.mark.parametrize("slot", [0, 1], ids=["first_fault", "second_fault"])
def test_ranges_are_filled_uniformly(slot):
    ranges = dict(
        severity=(0.3, 0.6), onset=(2.0, 9.0), ramp=(1.0, 3.0), period=(4.0, 5.0), duty=(0.2, 0.9)
    )
    fault, profile = drawn(
        healthy=0.0,
        compound=1.0,
        incipient=1.0,
        intermittent=1.0,
        repaired=1.0,
        life=(7.0, 8.0),
        **ranges,
    )
    for name, (low, high) in ranges.items():
        has_range = (fault[:, slot] >= 0) & ~np.isin(fault[:, slot], LOSSES)
        assert_uniform(profile[name][has_range, slot], low, high)
    assert_uniform(profile["end"][:, slot] - profile["onset"][:, slot], 7.0, 8.0)


@pytest.mark.parametrize("slot", [0, 1], ids=["first_fault", "second_fault"])
def test_profiles_have_their_shares(slot):
    _, profile = drawn(healthy=0.0, compound=1.0)
    default = ScheduleSampler()
    assert_share(profile["ramp"][:, slot] > 0.0, default.incipient)
    assert_share(profile["period"][:, slot] > 0.0, default.intermittent)
    assert_share(np.isfinite(profile["end"][:, slot]), default.repaired)
    assert ((profile["duty"][:, slot] < 1.0) == (profile["period"][:, slot] > 0.0)).all()


def test_default_ranges_are_the_declared_ones():
    fault, profile = drawn()
    default = ScheduleSampler()
    present = fault >= 0
    graded = present & ~np.isin(fault, LOSSES)
    assert_uniform(profile["severity"][graded], *default.severity)
    assert_uniform(profile["onset"][present], *default.onset)


def test_a_propeller_is_lost_as_a_whole_whatever_the_range():
    for severity in ((0.2, 1.0), (0.05, 0.2)):
        fault, profile = drawn(healthy=0.0, compound=1.0, severity=severity)
        lost = np.isin(fault, LOSSES)
        assert (profile["severity"][lost] == 1.0).all() and lost.any(axis=0).all()
        assert profile["severity"][~lost].max() <= severity[1]


def lose_propellers_in_parts(monkeypatch):
    for row in LOSSES:
        name = list(CATALOGUE)[row]
        monkeypatch.setitem(CATALOGUE, name, replace(CATALOGUE[name], least_severity=0.0))


def test_whole_losses_change_no_other_number(monkeypatch):
    whole, changed = drawn()
    lost = np.isin(whole, LOSSES)
    lose_propellers_in_parts(monkeypatch)
    partial, profile = drawn()
    np.testing.assert_array_equal(whole, partial)
    for name, values in profile.items():
        compared = ~lost if name == "severity" else np.ones_like(lost)
        np.testing.assert_array_equal(values[compared], changed[name][compared], err_msg=name)
    assert profile["severity"][lost].min() < 0.3


def test_draws_of_a_lane_are_independent(monkeypatch):
    lose_propellers_in_parts(monkeypatch)
    fault, profile = drawn(healthy=0.0, compound=1.0, incipient=1.0)
    columns = [fault[:, 0], fault[:, 1]] + [
        profile[name][:, k] for name in ("onset", "severity", "ramp") for k in (0, 1)
    ]
    correlation = np.corrcoef(columns) - np.eye(len(columns))
    assert np.abs(correlation).max() < stats.norm.isf(RISK / 56) / np.sqrt(N_LANES)


def test_later_episodes_draw_anew_from_the_same_distribution():
    later = episode_keys(np.zeros(N_LANES, np.uint64), np.arange(N_LANES, dtype=np.uint64))
    events = ScheduleSampler().sample_events(later)
    assert_share(events.fault[:, 0] < 0, 0.2)
    assert_uniform(events.profile[events.fault[:, 0] >= 0, 0, 0], 5.0, 30.0)


def test_sample_is_what_an_environment_with_that_seed_draws():
    n = 40
    sampler = ScheduleSampler()
    sampled = PropulsionVectorEnv(n, truth="full")
    given = PropulsionVectorEnv(n, truth="full")
    schedules = [sampler.sample(seed) for seed in range(100, 100 + n)]
    assert {len(schedule) for schedule in schedules} == {0, 1, 2}
    one = sampled.reset(seed=100)[0]
    two = given.reset(seed=100, options={"schedules": schedules})[0]
    for _ in range(400):
        assert one.tobytes() == two.tobytes()
        one, two = (env.step(np.c_[one[:, 0], np.zeros((n, 2))])[0] for env in (sampled, given))
    onsets = [min((event.onset for event in schedule), default=np.inf) for schedule in schedules]
    assert given.step(np.zeros((n, 3)))[4]["truth"]["onset"].tolist() == onsets


@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**63])
def test_sampled_schedules_survive_json(seed):
    schedule = ScheduleSampler(healthy=0.0, compound=1.0).sample(seed)
    assert len(schedule) == 2 and from_json(to_json(schedule)) == schedule


def test_fleet_takes_a_sampler():
    fleet = Fleet(
        50, schedules=ScheduleSampler(prior={"increased_drag": 1.0}, healthy=0.0, compound=0.0)
    )
    fleet.reset(range(50))
    assert set(fleet.plan.fault[fleet.plan.fault >= 0].tolist()) == {
        list(CATALOGUE).index("increased_drag")
    }


def test_missions_follow_their_declared_distribution():
    sampler = MissionSampler(speed=(0.2, 0.5), duration=(3.0, 4.0), n_legs=4, from_rest=0.3)
    legs, start_speed = sampler.sample_legs(KEY)
    assert legs.shape == (N_LANES, 4, 2) and (legs[:, 0, 0] == 0.0).all()
    assert_uniform(legs[:, :, 1].ravel(), 0.2, 0.5)
    assert_uniform(np.diff(legs[:, :, 0], axis=1).ravel(), 3.0, 4.0)
    assert_share(start_speed == 0.0, 0.3)
    moving = start_speed > 0.0
    assert (start_speed[moving] == legs[moving, 0, 1]).all()


def test_schedules_missions_and_vehicles_are_drawn_independently():
    fleet = Fleet(N_LANES)
    fleet.reset(range(N_LANES))
    healthy = (fleet.plan.fault[:, 0] < 0).astype(float)
    columns = [
        healthy,
        fleet.plan.legs[:, 0, 1],
        fleet.plan.healthy[:, 0],
        fleet.plan.healthy[:, 2],
    ]
    correlation = np.corrcoef(columns) - np.eye(len(columns))
    assert np.abs(correlation).max() < stats.norm.isf(RISK / 12) / np.sqrt(N_LANES)


def test_a_second_fault_is_another_one():
    fault, _ = drawn(
        healthy=0.0, compound=1.0, prior={"increased_drag": 9.0, "motor_overheating:port": 1.0}
    )
    assert (fault >= 0).all() and (fault[:, 0] != fault[:, 1]).all()
    assert (drawn(healthy=0.0, compound=1.0, prior={"increased_drag": 1.0})[0][:, 1] < 0).all()
