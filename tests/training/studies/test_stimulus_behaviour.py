"""What stimuli do: the loop against that of the benchmark, and averages over runs made by hand."""

import functools

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import make
from training.benchmark.suites import load
from training.benchmark.trials import FAULTY, Entrant, Trial, simulate_trial
from training.seeds import purpose_of
from training.stimuli import STIMULI
from training.stimuli.known_onset import FasterFromOnset
from training.studies import stimulus_behaviour
from training.studies.stimulus_behaviour import (
    EPISODE_CLASSES,
    ClosedLoopRun,
    behaviour,
    budget_shares,
    faulty_lanes,
    healthy_lanes,
    median_episodes,
    offsets_around_onset,
    record_closed_loop,
)
from training.studies.stimulus_comparisons import AGENT

STANDARD = load("standard")
N_SAMPLES = 650


def test_the_loop_is_that_of_the_benchmark():
    episodes = STANDARD.episodes[:6]
    bank = Entrant("filter_bank", functools.partial(make, "filter_bank"))
    observations, record, _, speed_rms = simulate_trial(
        Trial(bank, STIMULI["greedy"](0.1), FAULTY, STANDARD.conditions, episodes)
    )
    run = record_closed_loop(STIMULI["greedy"](0.1), "filter_bank", episodes, STANDARD.conditions)
    np.testing.assert_array_equal(run.log_normal.astype(np.float32), record.log_normal)
    np.testing.assert_array_equal(run.top, record.fault)
    command = observations[1:, :, INDEX["speed_command"]]
    np.testing.assert_allclose((run.mission + run.offset)[:-1], command, atol=1e-6)
    deviation = np.sqrt(np.mean(np.square(run.speed - run.mission), axis=0))
    np.testing.assert_allclose(deviation, speed_rms, rtol=0.02)
    assert np.abs(run.offset).max() > 0.05 and (run.log_true <= 1e-9).all()
    right = run.top[-1] == [
        classes().index(CATALOGUE[one.schedule[0].fault].diagnosis) for one in episodes
    ]
    assert (run.log_true[-1][right] > np.log(1.0 / len(classes()))).all()


def test_lanes_have_every_class_as_often_and_nobody_was_scored_on_them():
    conditions = STANDARD.conditions
    faulty = faulty_lanes(conditions, 4, 0)
    healthy = healthy_lanes(conditions, 30, 0)
    events = [event for episode in faulty for event in episode.schedule]
    of_class = [CATALOGUE[event.fault].diagnosis for event in events]
    assert of_class == [name for name in classes()[1:-1] for _ in range(4)]
    assert len({event.fault for event in events if event.fault.endswith(":speed")}) == 4
    assert all(
        event.ramp == 0.0 and 10.0 <= event.onset <= 30.0 and 0.2 <= event.severity <= 1.0
        for event in events
    )
    assert not any(episode.schedule for episode in healthy)
    seeds = [episode.seed for episode in (*faulty, *healthy)]
    assert len(set(seeds)) == len(seeds) and {purpose_of(seed) for seed in seeds} == {"validation"}
    assert seeds[:3] != [episode.seed for episode in faulty_lanes(conditions, 4, 1)][:3]


def run_of(offset, **more):
    """A run with these offsets, all else zero."""
    nothing = np.zeros_like(offset)
    return ClosedLoopRun(
        *(more.get(name, offset if name == "offset" else nothing) for name in ClosedLoopRun._fields)
    )


def test_offsets_are_averaged_by_class_over_the_time_since_onset():
    """One lane goes 0.1 m/s faster from its onset on, one of the same class 0.1 m/s slower, another
    0.2 m/s faster.
    """
    onset = np.array([10.0, 20.0, 30.0])
    fault = np.array([1, 1, 5])
    began = np.arange(N_SAMPLES)[:, None] * SAMPLE_TIME >= onset - 1e-9
    offsets = offsets_around_onset({"greedy": run_of(began * [0.1, -0.1, 0.2])}, fault, onset)
    time = np.array(offsets["time"])
    assert time[0] == -9.75 and time[-1] == 24.75
    after = time > 0.0
    for kind, alone in (("mean", 0.0), ("absolute", 0.1)):
        np.testing.assert_allclose(offsets[kind][classes()[1]]["greedy"], alone * after, atol=1e-9)
        np.testing.assert_allclose(offsets[kind][classes()[5]]["greedy"], 0.2 * after)
        assert list(offsets[kind]) == [classes()[1], classes()[5]]


def test_shares_of_the_budget_are_root_mean_squares_and_those_of_the_agents_seeds_are_pooled():
    squared = {"greedy": np.full((1, 5), 0.02**2), "learned": np.full((1, 5), 0.03**2)}
    share_by_stimulus = budget_shares(squared | {"learned_4": np.full((1, 5), 0.04**2)}, 0.1, 0)
    np.testing.assert_allclose(share_by_stimulus["greedy"], [0.2] * 3)
    value, low, high = share_by_stimulus[AGENT]
    assert value == pytest.approx(np.sqrt((0.3**2 + 0.4**2) / 2))
    assert low == pytest.approx(0.3) and high == pytest.approx(0.4)  # one of the seeds twice


def test_with_known_onset_it_goes_ahead_from_then_on_until_the_allowance_is_spent():
    reading = np.full((2, len(CHANNELS)), 0.3)
    stimulus = FasterFromOnset(0.05, onset=np.array([1.0, 3.0]))
    offset = np.array([stimulus.offset(k, reading, None) for k in range(N_SAMPLES)])
    for lane, first in enumerate((10, 30)):
        # 0.05^2 65 s
        assert not offset[:first, lane].any() and (offset[first : first + 26, lane] == 0.25).all()
        assert not offset[first + 27 :, lane].any()
    assert np.sqrt(np.square(offset).mean(axis=0)) == pytest.approx([0.05] * 2)
    free = FasterFromOnset(0.25, onset=np.array([1.0, 3.0]))
    assert [free.offset(k, reading, None)[1] for k in range(N_SAMPLES)][-1] == 0.25


def test_the_episode_drawn_of_a_class_is_that_of_its_median_isolation_time():
    """Three lanes of each class, right and alarmed 4 s, 9 s and never after onset."""
    of_class = np.repeat([classes().index(name) for name in EPISODE_CLASSES], 3)
    onset = np.full(of_class.size, 12.0)
    delay = np.tile([np.inf, 4.0, 9.0], len(EPISODE_CLASSES))
    is_alarmed = np.arange(N_SAMPLES)[:, None] * SAMPLE_TIME >= onset + delay - 1e-9
    lane = np.broadcast_to(np.arange(of_class.size), is_alarmed.shape)
    run = run_of(
        lane * 1.0,
        log_normal=np.where(is_alarmed, -9.0, -1.0),
        top=np.broadcast_to(of_class, is_alarmed.shape),
    )
    episodes = median_episodes(run, of_class, onset, -5.0)
    assert [one["class"] for one in episodes] == list(EPISODE_CLASSES)
    # the alarm asks for three samples in a row
    assert [one["isolation"] for one in episodes] == [9.2] * len(EPISODE_CLASSES)
    assert [one["offset"][0] for one in episodes] == [
        3.0 * k + 2.0 for k in range(len(EPISODE_CLASSES))
    ]
    assert episodes[0]["onset"] == 12.0 and episodes[0]["time"][:2] == [0.0, 0.2]
    assert episodes[0]["normal"][0] == pytest.approx(np.exp(-1.0), abs=1e-4)


def test_on_healthy_vehicles_the_thesis_spends_all_and_a_trigger_little(monkeypatch):
    for name, value in (("PER_CLASS", 1), ("N_HEALTHY", 6)):
        monkeypatch.setattr(stimulus_behaviour, name, value)
    results = behaviour(["thesis", "greedy"], ["thesis", "greedy"], 0.05, "filter_bank", -6.0, 1, 0)
    share = results["healthy"]["share"]
    assert share["thesis"][0] == pytest.approx(1.0, abs=0.02) and share["greedy"][0] < 0.5
    assert results["episodes"]["stimulus"] == "greedy" and len(results["episodes"]["drawn"]) == len(
        EPISODE_CLASSES
    )
    size = np.array(results["around_onset"]["absolute"]["increased_drag"]["thesis"])
    assert size.max() <= 0.05 + 1e-4 and size.min() > 0.03
    known_onset = results["known_onset"]
    assert list(known_onset) == [
        "thesis",
        "greedy",
        "cruise",
        "onset known",
        "onset known, without budget",
    ]
    assert known_onset["onset known, without budget"]["difference"]["cruise"][0] < -1.0
    again = behaviour(["greedy"], ["greedy"], 0.05, "filter_bank", -6.0, 1, 0)
    assert again["healthy"]["share"]["greedy"] == share["greedy"]
