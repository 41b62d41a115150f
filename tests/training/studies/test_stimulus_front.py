"""Costs, thresholds and fronts by hand, vehicles that serve once, a small study that goes on."""

import json
import math
from collections import Counter

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from training.benchmark import suites
from training.benchmark.trials import COUNTING, FAULTY, THRESHOLD
from training.metrics.records import HIGHEST_THRESHOLD
from training.stimuli import STIMULI
from training.stimuli.base import BUDGET
from training.stimuli.known_onset import NEVER
from training.studies import stimulus_front, stimulus_front_runs
from training.studies.stimulus_comparisons import AGENT
from training.studies.stimulus_front import Member, StimulusFront, grouped, main, mark_fronts
from training.studies.stimulus_front_runs import (
    FrontRun,
    Point,
    diagnosis_of,
    jobs_of,
    lanes_of,
    path_of,
    point_of,
)
from training.studies.stimulus_front_scores import (
    at_cost,
    compared,
    cost,
    detected,
    false_alarms,
    threshold_at,
)

N_SAMPLES = 650
CLASSES = ("increased_drag", "sensor:speed")


def run_of(offset, energy, distance, log_normal=None):
    """A run of two lanes with this offset (n_samples,) [m/s], energy [J] and distance [m] each."""
    series = np.zeros((N_SAMPLES, 2)) if log_normal is None else log_normal
    return FrontRun(
        log_normal=series,
        top=np.ones_like(series, np.int8),
        offset_mean=np.full(2, offset.mean()),
        offset_square=np.full(2, np.square(offset).mean()),
        energy=np.full(2, energy),
        distance=np.full(2, distance),
    )


def test_costs_are_those_of_known_offsets():
    """Half of the time 0.1 m/s faster and half as they were; 70 J over 20 m in place of 30 J over
    15 m, both in 65 s.
    """
    offset = np.repeat([0.1, 0.0], N_SAMPLES // 2)
    found = cost(run_of(offset, 70.0, 20.0), run_of(0.0 * offset, 30.0, 15.0))
    assert found["rms"] == pytest.approx(0.1 / math.sqrt(2.0))
    assert found["rms_without_mean"] == pytest.approx(0.05)
    assert found["energy"] == pytest.approx(1.5) and found["energy_share"] == pytest.approx(0.75)
    assert found["time"] == pytest.approx(1000.0 * (65.0 / 20.0 - 65.0 / 15.0))
    assert found["time_share"] == pytest.approx(-0.25)


def test_a_constant_costs_its_strength_and_nothing_around_its_mean():
    found = cost(run_of(np.full(N_SAMPLES, 0.05), 1.0, 1.0), run_of(np.zeros(N_SAMPLES), 1.0, 1.0))
    assert found["rms"] == pytest.approx(0.05)
    assert found["rms_without_mean"] == pytest.approx(0.0, abs=1e-7)


def test_the_passive_run_costs_nothing():
    passive = run_of(np.zeros(N_SAMPLES), 30.0, 15.0)
    assert set(cost(passive, passive).values()) == {0.0}


def test_a_threshold_is_counted_where_the_hours_suffice():
    """400 vehicles of 65 s, 7.2 h; five of them fall for a second to -9, -8, ..."""
    log_normal = np.full((N_SAMPLES, 400), -0.01)
    for lane, depth in enumerate((-9.0, -8.0, -7.0, -6.0, -5.0)):
        log_normal[100:110, lane] = depth
    threshold, is_extrapolated = threshold_at(log_normal, 3600.0)
    assert not is_extrapolated and threshold == HIGHEST_THRESHOLD
    threshold, is_extrapolated = threshold_at(log_normal, 2.5 * 3600.0)
    assert not is_extrapolated and threshold == -7.0  # two in 7.2 h


def test_an_exponential_tail_is_extrapolated_to_its_quantile():
    """Lowest values exponentially distributed with mean 2: so that a share of exp(-x / 2) of the
    vehicles falls below -x.
    """
    depth = 2.0 * np.log(np.arange(1, 1001) / 1000.0)
    log_normal = np.zeros((N_SAMPLES, 1000))
    log_normal[300:310] = depth
    seconds = 1000 * 65.0
    threshold, is_extrapolated = threshold_at(log_normal, 20.0 * seconds)
    assert is_extrapolated
    assert threshold == pytest.approx(-2.0 * math.log(20_000.0), rel=0.03)
    assert threshold < threshold_at(log_normal, 2.0 * seconds).value


def test_faults_are_isolated_where_an_alarm_names_them_to_the_end():
    log_normal = np.full((N_SAMPLES, 2), -0.1)
    log_normal[140:, 0] = -9.0
    run = run_of(np.zeros(N_SAMPLES), 1.0, 1.0, log_normal)
    found = detected(run, -5.0, np.array([1, 2]), np.array([10.0, 10.0]))
    # three samples in a row raise the alarm; the second vehicle has none
    assert found.isolation.time == pytest.approx([4.2, 30.0])
    assert found.detection.time == pytest.approx([4.2, 30.0])
    counted = false_alarms(run, -5.0)
    assert counted["count"] == 1 and counted["hours"] == pytest.approx(2 * 65.0 / 3600.0)


def test_two_stimuli_with_the_same_times_have_a_ratio_of_one():
    times = np.random.default_rng(0).uniform(1.0, 30.0, (1, 40))
    same = compared(times, times, 0)
    assert same["ratio"] == [1.0, 1.0, 1.0] and same["difference"] == [0.0, 0.0, 0.0]
    half = compared(0.5 * times, times, 0)
    assert half["ratio"] == pytest.approx([0.5] * 3)
    assert half["mean"][0] == pytest.approx(0.5 * times.mean())


def test_between_two_strengths_times_are_linear_in_the_mean_square():
    slow = np.full((1, 4), 8.0)
    fast = np.full((1, 4), 4.0)
    costs = [0.1, 0.0]
    np.testing.assert_allclose(at_cost(costs, [fast, slow], 0.05), 7.0)  # a quarter of the way
    np.testing.assert_array_equal(at_cost(costs, [fast, slow], 0.1), fast)
    np.testing.assert_array_equal(at_cost(costs, [fast, slow], 0.09999), fast)
    assert at_cost(costs, [fast, slow], 0.11) is None


def row(name, rms, energy, isolation):
    rates = {"1 h": {"isolation": {"mean": [isolation, 0.0, 30.0]}}}
    return {"stimulus": name, "healthy": {"rms": rms, "energy": energy}, "rates": rates}


def test_a_point_is_on_the_front_of_a_cost_unless_another_one_improves_it_in_both():
    rows = [
        row("cruise", 0.0, 0.0, 9.0),
        row("dear", 0.1, 5.0, 6.0),
        row("cheap", 0.05, 6.0, 6.0),
        row("best", 0.07, 7.0, 4.0),
        row("known_onset", 0.0, 0.0, 1.0),
    ]
    mark_fronts(rows)
    assert [one["fronts"]["rms"] for one in rows] == [True, False, True, True, False]
    assert [one["fronts"]["energy"] for one in rows] == [True, True, False, True, False]


def test_vehicles_of_the_parts_differ_and_every_class_is_there_as_often():
    suite = suites.load("standard")
    lanes = lanes_of(suite, CLASSES, 3, 4, 0.1, 0)
    seeds = [episode.seed for part in lanes.episodes.values() for episode in part]
    assert len(set(seeds)) == len(seeds) == 2 * 3 + 4 + 6
    found = Counter(diagnosis_of(episode) for episode in lanes.episodes[FAULTY])
    assert found == dict.fromkeys(CLASSES, 3)
    assert set(lanes.episodes[FAULTY]) <= set(suite.episodes)
    assert not any(one.schedule for part in (COUNTING, THRESHOLD) for one in lanes.episodes[part])
    # as long as faulty ones, though the suite has whole missions
    assert set(lanes.conditions.lengths(lanes.episodes[THRESHOLD])) == {N_SAMPLES}
    others = lanes_of(suite, CLASSES, 3, 4, 0.1, 1)
    assert not {one.seed for part in others.episodes.values() for one in part} & set(seeds)


def test_more_vehicles_than_a_suite_has_are_refused():
    with pytest.raises(InputError, match="vehicles of a class"):
        lanes_of(suites.load("ideal"), CLASSES, 1000, 4, 0.1, 0)


def test_a_point_is_a_stimulus_and_its_budget_and_all_else_is_refused():
    assert point_of("thesis:0.05") == Point("thesis", 0.05)
    assert point_of(Point("constant", 0.1).label) == Point("constant", 0.1)
    for text, match in (
        ("thesis", "point"),
        ("thesys:0.05", "stimulus of a point"),
        ("thesis:-1", "strength of thesis"),
    ):
        with pytest.raises(InputError, match=match):
            point_of(text)


def test_a_file_is_of_one_point_and_its_vehicles_and_the_known_onset_is_theirs(
    tmp_path,
):
    lanes = lanes_of(suites.load("ideal"), CLASSES, 2, 3, 0.1, 0)
    points = [Point("thesis", 0.05), Point("thesis", 0.06), Point("constant", 0.05)]
    paths = {path_of(tmp_path, job) for point in points for job in jobs_of(point, lanes)}
    assert len(paths) == 3 * 3
    more = lanes_of(suites.load("ideal"), CLASSES, 2, 4, 0.1, 0)
    again = {path_of(tmp_path, job) for job in jobs_of(points[0], more)}
    assert len(again & paths) == 2  # the faulty ones and those for thresholds
    faulty, counting, _ = jobs_of(Point("known_onset", 0.1), lanes)
    onset = [episode.schedule[0].onset for episode in lanes.episodes[FAULTY]]
    np.testing.assert_allclose(faulty.stimulus.onset, onset)
    assert set(counting.stimulus.onset) == {NEVER}


def member(name, strength, times):
    part = {"rms": 0.1 * times[0]}
    return Member(Point(name, strength), {"healthy": part}, {"1 h": np.array(times)})


def test_trainings_of_the_agent_count_together_at_each_strength():
    members = [
        member("thesis", 0.05, [5.0, 6.0]),
        member("learned", 0.05, [1.0, 2.0]),
        member("learned_1", 0.05, [3.0, 4.0]),
        member("learned", 0.1, [0.5, 0.5]),
        member("learned_held", 0.05, [7.0, 7.0]),
    ]
    groups = grouped(members)
    assert [(one.stimulus, one.strength) for one in groups] == [
        ("thesis", 0.05),
        (AGENT, 0.05),
        ("learned", 0.1),
        ("learned_held", 0.05),
    ]
    np.testing.assert_array_equal(groups[1].times("1 h"), [[1.0, 2.0], [3.0, 4.0]])
    assert groups[1].cost("healthy")["rms"] == pytest.approx(0.2)


def study(folder, *points):
    """Points of a small study, and all of its results."""
    arguments = StimulusFront(
        points=points,
        per_class=1,
        healthy=2,
        hours=0.03,
        workers=1,
        output=folder / "run",
        cache=folder / "cache",
    )
    main(arguments)
    results = json.loads((folder / "run" / "results.json").read_text("utf-8"))
    return {(one["stimulus"], one["strength"]): one for one in results["points"]}, results


def test_a_small_study_goes_on_where_it_stopped(tmp_path, monkeypatch):
    # quick, and as good for this
    monkeypatch.setattr(stimulus_front_runs, "DIAGNOSER", "limits")
    stimulus_front_runs.loop_code.cache_clear()
    first, _ = study(tmp_path)
    assert list(first) == [("cruise", 0.0), ("thesis", BUDGET), ("known_onset", 0.1)]
    files = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").glob("*.npz")}
    assert len(files) == 3 * 3
    second, results = study(tmp_path, "constant:0.05", "multisine:0")
    stimulus_front_runs.loop_code.cache_clear()
    assert {path: path.stat().st_mtime_ns for path in files} == files
    constant = second["constant", 0.05]["healthy"]
    assert constant["rms"] == pytest.approx(0.05, rel=0.01)
    assert constant["rms_without_mean"] < 0.005 and constant["time"] < 0.0 < constant["energy"]
    # without an offset it is cruise
    silent = second["multisine", 0.0]
    passive = second["cruise", 0.0]
    assert silent["healthy"] == silent["faulty"] == passive["healthy"]
    assert set(silent["healthy"].values()) == {0.0}
    assert silent["rates"] == passive["rates"]
    assert set(results["equal_cost"]) == {"thesis", "constant", "multisine"}
    at_thesis = results["equal_cost"]["thesis"][f"{BUDGET:g}"]
    assert at_thesis["ratio"] == pytest.approx([1.0, 1.0, 1.0])
    assert results["equal_cost"]["constant"]["0.1"] is None
    assert results["lanes"] == {FAULTY: 7, COUNTING: 2, THRESHOLD: 2}
    assert (tmp_path / "run" / "figures" / "front.png").is_file()


def test_the_default_points_are_stimuli_that_exist_and_the_known_onset():
    names = {point_of(text).stimulus for text in stimulus_front.MAIN_POINTS}
    assert names <= {*STIMULI, "known_onset"}
    assert set(CLASSES) <= set(classes())


@pytest.mark.parametrize(
    ("changes", "match"),
    [({"hours": 0.0}, "hours"), ({"per_class": 0}, "per_class"), ({"suite": "nice"}, "suite")],
)
def test_bad_arguments_are_refused(changes, match, tmp_path):
    with pytest.raises(InputError, match=match):
        main(StimulusFront(**changes, output=tmp_path / "run"))
