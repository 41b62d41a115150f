from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from auv_fault_env.channels import INDEX
from auv_fault_env.errors import InputError
from auv_fault_env.missions import Mission
from diagnosers import make
from training.benchmark import plan, suites
from training.benchmark.suites import Episode, noise_keys
from training.benchmark.trials import COUNTING, Entrant, Trial, run_trial, simulate_trial
from training.benchmark.whole_missions import WholeMissionSampler
from training.metrics.records import HIGHEST_THRESHOLD
from training.stimuli import STIMULI

RANDOM = Entrant("random", partial(make, "random"))
SAMPLER = WholeMissionSampler()
CONDITIONS = replace(suites.load("thesis").conditions, whole_missions=SAMPLER)


def test_missions_last_from_a_minute_to_two_hours_with_rest_at_both_ends():
    missions = SAMPLER.sample(noise_keys(range(400)))
    durations = np.array([one.duration for one in missions])
    assert 60.0 <= durations.min() < 90.0 and 6000.0 < durations.max() <= 7200.0
    # log-uniform: half are shorter than the geometric mean
    assert 0.4 < (durations < np.sqrt(60.0 * 7200.0)).mean() < 0.6
    for mission, duration in missions:
        legs = mission.legs
        assert mission.start_speed == 0.0 and legs[0] == (0.0, 0.0) and legs[-1][1] == 0.0
        first_rest = legs[1][0]
        last_rest = duration - legs[-1][0]
        for rest in (first_rest, last_rest):
            assert min(10.0, 0.25 * duration) - 0.1 <= rest <= 240.0
        assert all(0.15 <= speed <= 0.6 for _, speed in legs[1:-1])
    n_legs = np.array([len(one.mission.legs) - 2 for one in missions])
    assert 0.25 < (n_legs == 1).mean() < 0.5


def test_durations_are_those_of_the_missions():
    key = noise_keys(range(50))
    durations = [one.duration for one in SAMPLER.sample(key)]
    np.testing.assert_allclose(SAMPLER.durations(key), durations)


@pytest.mark.parametrize(
    "fields", [{"duration": (10.0, 60.0)}, {"rest": (20.0, 10.0)}, {"constant": 1.5}]
)
def test_impossible_missions_are_refused(fields):
    with pytest.raises(InputError):
        WholeMissionSampler(**fields)


def test_a_suite_with_whole_missions_is_read_as_it_was_written(tmp_path):
    suite = replace(suites.load("thesis"), conditions=CONDITIONS)
    path = tmp_path / "mine.json"
    path.write_text(suite.text(), encoding="utf-8")
    assert suites.load(str(path)).conditions == CONDITIONS


def test_there_are_just_enough_lanes_for_the_hours():
    lanes = plan.enough_lanes(CONDITIONS, 4_000_000_000, 36_000.0)
    durations = CONDITIONS.durations(lanes)
    assert durations.sum() >= 36_000.0 > durations[:-1].sum()


def test_lanes_of_a_trial_are_of_about_the_same_duration_and_few():
    episodes = CONDITIONS.healthy_episodes(range(4_000_000_000, 4_000_000_600))
    chunks = plan.chunks(CONDITIONS, episodes)
    assert sorted(one.seed for chunk in chunks for one in chunk) == [one.seed for one in episodes]
    padded = 0
    for chunk in chunks:
        lengths = CONDITIONS.lengths(chunk)
        assert len(chunk) <= 256 and len(chunk) * lengths.max() <= plan.MOST_SAMPLES
        padded += len(chunk) * lengths.max()
    assert padded < 1.4 * CONDITIONS.lengths(episodes).sum()


def trial(*durations):
    missions = [one.mission for one in SAMPLER.sample(noise_keys(range(len(durations))))]
    numbered = enumerate(zip(missions, durations, strict=True))
    lanes = tuple(Episode(4_999_000_000 + k, (), *one) for k, one in numbered)
    return Trial(RANDOM, STIMULI["thesis"](), COUNTING, CONDITIONS, lanes)


def test_a_lane_counts_until_its_end_as_if_it_were_alone():
    together = run_trial(trial(70.0, 90.0))
    np.testing.assert_allclose(together.hours * 3600.0, [70.0, 90.0])
    alone = run_trial(trial(70.0))
    assert together.least[0] == alone.least[0]
    assert together.begin.max() < 90.0 and alone.begin.max() < 70.0
    np.testing.assert_array_equal(together.depth[:, 0], alone.depth[:, 0])
    assert (together.low <= HIGHEST_THRESHOLD).all()


def test_a_vehicle_at_rest_is_not_disturbed():
    waiting = Mission(((0.0, 0.0), (50.0, 0.3)), 0.0)
    lane = Episode(4_999_000_007, (), waiting, 70.0)
    observations = simulate_trial(trial(70.0)._replace(episodes=(lane,))).observations
    command = observations[:, 0, INDEX["speed_command"]]
    assert not command[:500].any() and command[505:].all()
