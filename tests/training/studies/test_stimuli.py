"""Comparisons by hand, targets met and missed, input that is none, and a page made from results
alone.
"""

import json
import re

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from training.bounds import active_ceiling
from training.report.figures.registry import draw
from training.studies import run, stimuli, stimulus_behaviour
from training.studies.stimuli import (
    DIAGNOSER,
    StimulusStudy,
    find_ceilings,
    load_benchmark,
    load_benchmarks,
    main,
)
from training.studies.stimuli_page import MET, MISSED, OPEN, page, verdicts
from training.studies.stimulus_behaviour import (
    ClosedLoopRun,
    budget_shares,
    median_episodes,
    offsets_around_onset,
)
from training.studies.stimulus_comparisons import (
    AGENT,
    SUBSETS,
    compare_by_subset,
    mean_costs,
    paired_figures,
    pareto_front,
    resampled_means,
    speed_up,
    without_single_seeds,
)

FAULTS = list(classes()[1:])
LANES = 6 * len(FAULTS)
FAULT = np.resize(np.arange(len(FAULTS)) + 1, LANES)
OPEN_LOOP = ("cruise", "thesis", "triggered_thesis", "greedy")
SPEED = {
    "cruise": 1.0,
    "thesis": 0.6,
    "triggered_thesis": 0.4,
    "greedy": 0.35,
    "learned": 0.2,
    "learned_1": 0.24,
}


def times(values):
    return np.array([values], float)


def score(isolation, cost=0.05):
    lanes = {"isolation": np.round(isolation, 4).tolist(), "isolated": (isolation < 30.0).tolist()}
    rates = {"1 h": {"false_alarms_per_hour": 1.2}}
    return {
        "by_lane": lanes,
        "cost": {"speed_rms": cost, "energy": 200.0 + 1000.0 * cost},
        "rates": rates,
    }


def benchmark(budget=0.05, stimuli=(*OPEN_LOOP, "learned", "learned_1"), **changes):
    """What `auv-fault benchmark` would write of what this study reads."""
    slow = np.random.default_rng(0).uniform(4.0, 20.0, LANES)
    scores = {
        stimulus: {
            name: score(SPEED[stimulus] * slow * (1.0 + k))
            for k, name in enumerate((DIAGNOSER, "limits"))
        }
        for stimulus in stimuli
    }
    return {
        "command": "auv-fault benchmark",
        "revision": None,
        "suite": {"name": "standard", "hash": "a" * 64, "every": 1},
        "classes": list(classes()),
        "references": ["limits"],
        "episodes": {"fault": FAULT.tolist()},
        "settings": {"stimuli": dict.fromkeys(stimuli, budget)},
        "thresholds": {DIAGNOSER: {"1 h": -6.0}, "limits": {"1 h": None}},
        "scores": scores,
    } | changes


def written(folder, name="results.json", **changes):
    path = folder / name
    path.write_text(json.dumps(benchmark(**changes)), encoding="utf-8")
    return path


def test_a_stimulus_that_is_always_as_much_sooner_is_surely_so():
    thesis = np.linspace(2.0, 20.0, 40)
    figures = paired_figures(
        {"thesis": times(thesis), "cruise": times(2.0 * thesis), "prbs": times(thesis - 1.5)}, 0
    )
    np.testing.assert_allclose(figures["prbs"]["difference"]["thesis"], [-1.5] * 3)
    np.testing.assert_allclose(figures["thesis"]["ratio"]["cruise"], [0.5] * 3)
    mean, low, high = figures["thesis"]["mean"]
    error = thesis.std() / np.sqrt(40)
    assert mean == pytest.approx(11.0) and low == pytest.approx(mean - 1.96 * error, abs=0.3)
    assert high == pytest.approx(mean + 1.96 * error, abs=0.3)
    assert figures["prbs"]["spread"] is None and figures["thesis"]["isolated"] == 1.0


def test_the_interval_of_the_agent_knows_that_its_seeds_differ():
    """Two seeds of 1 s and 3 s on all lanes: a quarter of the resamples has 1 s, half 2 s, a
    quarter 3 s.
    """
    values = np.array([[1.0] * 10, [3.0] * 10])
    lanes = np.random.default_rng(0).multinomial(10, np.full(10, 0.1), size=4000)
    drawn, share = np.unique(resampled_means(values, lanes, 0).round(9), return_counts=True)
    np.testing.assert_array_equal(drawn, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(share / 4000, [0.25, 0.5, 0.25], atol=0.03)
    one = resampled_means(values[:1] * np.arange(10), lanes, 0)
    np.testing.assert_allclose(one, lanes @ np.arange(10) / 10)


def test_figures_are_those_of_the_lanes_of_each_class_and_of_the_agents_seeds_together():
    scores = benchmark()["scores"]
    fault = [classes()[k] for k in FAULT]
    figures = compare_by_subset(scores, DIAGNOSER, fault, 0)
    assert list(figures) == [*SUBSETS, *FAULTS]
    own = {name: np.array(by[DIAGNOSER]["by_lane"]["isolation"]) for name, by in scores.items()}
    drag = FAULT == 1
    alike = np.isin(fault, SUBSETS["confounded"])
    assert 0 < alike.sum() == 6 * len(SUBSETS["confounded"])
    for subset, lanes in (("increased_drag", drag), ("confounded", alike), ("all", FAULT > 0)):
        seeds = [own[name][lanes].mean() for name in ("learned", "learned_1")]
        assert figures[subset]["greedy"]["mean"][0] == pytest.approx(own["greedy"][lanes].mean())
        assert figures[subset][AGENT]["mean"][0] == pytest.approx(np.mean(seeds))
        assert figures[subset][AGENT]["spread"] == pytest.approx(
            abs(seeds[0] - seeds[1]) / np.sqrt(2)
        )
        rival = figures[subset][AGENT]["difference"]["greedy"]
        assert (
            rival[0] == pytest.approx(np.mean(seeds) - own["greedy"][lanes].mean())
            and rival[1] < rival[0] < rival[2]
        )
    assert "greedy" not in figures["all"]["learned"]["difference"]
    assert (
        AGENT
        not in compare_by_subset({name: scores[name] for name in OPEN_LOOP}, DIAGNOSER, fault, 0)[
            "all"
        ]
    )
    assert without_single_seeds(figures["all"]) == [AGENT, *OPEN_LOOP]


def test_the_costs_of_the_agent_are_the_mean_of_its_seeds():
    scores = {
        name: {DIAGNOSER: score(np.ones(2), cost)}
        for name, cost in (("learned", 0.02), ("learned_3", 0.04))
    }
    assert mean_costs(scores, DIAGNOSER)[AGENT] == pytest.approx(
        {"speed_rms": 0.03, "energy": 230.0, "false_alarms_per_hour": 1.2}
    )


def test_on_the_front_nobody_is_beaten_in_both():
    points = [tuple(point) for point in np.random.default_rng(1).uniform(size=(60, 2))]
    chosen = pareto_front(points)
    for k, (cost, delay) in enumerate(points):
        beaten = any(c <= cost and d <= delay and (c, d) != (cost, delay) for c, d in points)
        assert (k in chosen) != beaten
    assert sorted(chosen, key=lambda k: points[k][0]) == chosen
    assert pareto_front([(1.0, 1.0), (1.0, 1.0)]) == [0]


def of_budget(half=0.45, sooner=-0.2, third=0.3, share=0.08):
    """Figures whose intervals are as wide as 0.04, and end at these."""
    agent = {
        "all": {
            "ratio": {"thesis": [half - 0.02, half - 0.04, half]},
            "difference": {
                "triggered_thesis": [-1.0, -1.1, -0.9],
                "greedy": [sooner - 0.02, sooner - 0.04, sooner],
            },
        },
        "confounded": {"ratio": {"cruise": [third - 0.02, third - 0.04, third]}},
    }
    figures = {"all": {AGENT: agent["all"], "triggered_thesis": {}, "greedy": {}, "prbs": {}}}
    figures["confounded"] = {AGENT: agent["confounded"]}
    behaviour = {"healthy": {"share": {AGENT: [share - 0.02, share - 0.04, share]}}}
    return {"figures": {DIAGNOSER: figures}, "behaviour": behaviour}


@pytest.mark.parametrize(
    ("missed", "changes"),
    [
        (None, {}),
        (0, {"half": 0.51}),
        (2, {"sooner": 0.01}),
        (3, {"third": 0.34}),
        (4, {"share": 0.11}),
    ],
)
def test_a_target_is_met_if_the_whole_interval_says_so(missed, changes):
    rows = verdicts(of_budget(**changes), DIAGNOSER)
    assert [verdict for _, verdict, _ in rows] == [MISSED if k == missed else MET for k in range(5)]
    assert "0.43 (0.41–0.45) times" in rows[0] or missed == 0


def test_without_the_agent_no_target_is_judged():
    results_of_budget = of_budget()
    for figures in results_of_budget["figures"][DIAGNOSER].values():
        del figures[AGENT]
    results_of_budget["behaviour"]["healthy"]["share"] = {"greedy": [0.1, 0.1, 0.1]}
    assert [verdict for _, verdict, _ in verdicts(results_of_budget, DIAGNOSER)] == [OPEN] * 5


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "No such file"),
        ("{", "JSONDecodeError"),
        ("[]", "results.json of auv-fault benchmark"),
        ('{"scores": {}}', "KeyError"),
        (benchmark(stimuli=("thesis", "greedy")), "thesis and cruise among them"),
        (benchmark(settings={"stimuli": {"cruise": 0.05, "thesis": 0.1}}), "all with one budget"),
        (benchmark(thresholds={"limits": {}}), f"{DIAGNOSER} among them"),
        (benchmark(scores=benchmark()["scores"] | {"thesys": {}}), "did you mean 'thesis'"),
    ],
)
def test_a_file_that_is_no_benchmark_of_stimuli_is_refused_by_name(tmp_path, content, words):
    path = tmp_path / "results.json"
    if content is not None:
        path.write_text(
            content if isinstance(content, str) else json.dumps(content), encoding="utf-8"
        )
    with pytest.raises(InputError, match=re.escape(words)) as refused:
        load_benchmark(path)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


def test_benchmarks_come_by_budget_and_must_be_of_one_suite(tmp_path):
    large = written(tmp_path, "a.json", budget=0.1)
    small = written(tmp_path, "b.json", budget=0.05)
    assert list(load_benchmarks([large, small])) == [0.05, 0.1]
    with pytest.raises(InputError, match=r"one file for each budget"):
        load_benchmarks([large, written(tmp_path, "c.json", budget=0.1)])
    other = written(tmp_path, "d.json", budget=0.2, suite={"name": "mine", "hash": "b", "every": 1})
    with pytest.raises(InputError, match="the same episodes in all"):
        load_benchmarks([large, other])
    with pytest.raises(InputError, match="suites of the results"):
        load_benchmarks([])


def ceiling_of(fault, seed, budget):
    return {
        "budget": budget,
        "profile": {"cycles": 1, "duty": 0.5, "roundness": 0.0},
        "active": 2.0,
        "passive": 0.001 if fault == "increased_drag" else 0.5,
        "passive_rival": "normal",
        "speed_up": 4.0,
        "free": 3.0,
        "levels": [0.0] * active_ceiling.LEVELS,
        "best": 3.0,
        "thesis": 1.0,
        "best_speed_up": None if fault == "increased_drag" else 6.0,
        "thesis_speed_up": 3.0,
    }


@pytest.fixture
def searched(monkeypatch):
    """What ceilings have been searched for."""
    searches = []
    monkeypatch.setattr(
        active_ceiling, "free_ceiling", lambda *one: searches.append(one) or ceiling_of(*one)
    )
    return searches


def test_ceilings_are_sought_once_unless_they_would_be_sought_otherwise(
    tmp_path, searched, monkeypatch
):
    path = tmp_path / "ceilings.json"
    faults = active_ceiling.FAULTS
    first = find_ceilings(path, [0.05], 1, 0)
    assert searched == [(fault, 0, 0.05) for fault in faults]
    more = find_ceilings(path, [0.05, 0.1], 1, 0)
    text = path.read_text()
    assert searched[len(faults) :] == [(fault, 0, 0.1) for fault in faults]
    assert list(more) == ["0.05", "0.1"] and more["0.05"] == first["0.05"]
    for seed, rounds, kept in ((1, 8, text), (0, 9, text), (0, 8, "{"), (0, 8, text)):
        path.write_text(kept)
        searched.clear()
        monkeypatch.setattr(active_ceiling, "ROUNDS", rounds)
        find_ceilings(path, [0.05, 0.1], 1, seed)
        assert len(searched) == (0 if (seed, rounds, kept) == (0, 8, text) else 2 * len(faults))


def test_what_is_found_before_a_break_is_kept(tmp_path, monkeypatch):
    tried = []

    def breaking(fault, seed, budget):
        tried.append(fault)
        if len(tried) == 4:
            raise KeyboardInterrupt
        return ceiling_of(fault, seed, budget)

    monkeypatch.setattr(active_ceiling, "free_ceiling", breaking)
    with pytest.raises(KeyboardInterrupt):
        find_ceilings(tmp_path / "ceilings.json", [0.05], 1, 0)
    find_ceilings(tmp_path / "ceilings.json", [0.05], 1, 0)
    assert tried[4:] == list(active_ceiling.FAULTS)[3:]


def random_run(n_lanes):
    """A run with random series."""
    random = np.random.default_rng(2)
    run_series = ClosedLoopRun(
        *random.uniform(0.0, 0.4, (len(ClosedLoopRun._fields), 650, n_lanes))
    )
    return run_series._replace(
        log_normal=-40.0 * run_series.log_normal,
        log_true=-run_series.log_true,
        top=run_series.top.round() + FAULT,
    )


def results(stimuli):
    """What `stimuli.summary` returns, from random runs."""
    fault = FAULT
    onset = np.resize(np.linspace(10.0, 30.0, 7), LANES)
    runs = {name: random_run(LANES) for name in stimuli if name != "cruise"}
    behaviour = {
        "around_onset": offsets_around_onset(runs, fault, onset),
        "healthy": {
            "lanes": 4,
            "share": budget_shares({name: np.full((1, 4), 0.001) for name in runs}, 0.05, 0),
        },
        "known_onset": paired_figures(
            {name: times(np.full(6, 9.0)) for name in (*runs, "cruise", "onset known")}, 0
        ),
        "episodes": {
            "stimulus": stimuli[-1],
            "drawn": median_episodes(runs[stimuli[-1]], fault, onset, -3.0),
        },
    }
    scores = benchmark(stimuli=stimuli)["scores"]
    names = [classes()[k] for k in fault]
    one = {
        "command": "auv-fault benchmark",
        "revision": "abc",
        "stimuli": list(stimuli),
        "figures": {
            name: compare_by_subset(scores, name, names, 0) for name in (DIAGNOSER, "limits")
        },
        "costs": {name: mean_costs(scores, name) for name in (DIAGNOSER, "limits")},
        "behaviour": behaviour,
        "ceilings": {fault: ceiling_of(fault, 0, 0.05) for fault in active_ceiling.FAULTS},
    }
    return {
        "command": "python -m training.studies.stimuli",
        "seed": 0,
        "suite": {"name": "standard", "hash": "a" * 64, "every": 1, "episodes": LANES},
        "diagnoser": DIAGNOSER,
        "references": ["limits"],
        "classes": FAULTS,
        "lanes": 6,
        "budgets": {"0.05": one, "0.1": one},
    }


@pytest.mark.parametrize(
    "stimuli", [OPEN_LOOP, (*OPEN_LOOP, "learned", "learned_1")], ids=["without", "with agent"]
)
def test_the_page_draws_every_figure_and_fills_every_table_from_results_alone(stimuli):
    sections = page(json.loads(json.dumps(results(stimuli))))["sections"]
    for section in sections:
        for figure in section.get("figures", ()):
            assert draw(figure["plot"], figure["data"]).axes
        for row in section.get("table", {}).get("rows", ()):
            assert len(row) == len(section["table"]["columns"])
            assert all(isinstance(cell, str) for cell in row)
    names = {section["heading"]: section for section in sections}
    main_rows = names[f"{DIAGNOSER}, 0.05 m/s"]["table"]["rows"]
    # the slowest; as long as itself
    assert main_rows[-1][0] == "cruise" and main_rows[-1][3].startswith("1.00")
    drag = next(
        row for row in names["How much a stimulus could achieve, 0.05 m/s"]["table"]["rows"]
    )
    assert drag[5:7] == ["no rate to compare with", "3.0"]
    assert (drag[7] == "–") == ("learned" not in stimuli)
    known_onset = names["What a known onset would achieve, 0.05 m/s"]["table"]["rows"]
    assert {"onset known", "thesis"} < {row[0] for row in known_onset}
    assert len(names["Six episodes"]["figures"][0]["data"]["drawn"]) == 6


def test_half_of_the_time_is_twice_as_soon_and_the_ends_change_places():
    assert speed_up([0.5, 0.25, 1.0]) == [2.0, 1.0, 4.0]


def test_the_command_writes_a_report_and_takes_ceilings_over(tmp_path, searched, monkeypatch):
    for name, value in (("PER_CLASS", 1), ("N_HEALTHY", 2)):
        monkeypatch.setattr(stimulus_behaviour, name, value)
    # drawing and the filter bank take the longest; both have their own tests
    monkeypatch.setattr(run, "write_report", lambda report, folder: None)
    monkeypatch.setattr(stimuli, "DIAGNOSER", "limits")
    path = written(tmp_path, stimuli=("cruise", "thesis"), thresholds={"limits": {"1 h": -6.0}})
    arguments = StimulusStudy((path,), tmp_path / "out", workers=1)
    main(arguments)
    first = json.loads((tmp_path / "out" / "results.json").read_text())
    assert list(first["budgets"]) == ["0.05"] and len(searched) == len(active_ceiling.FAULTS)
    assert first["budgets"]["0.05"]["behaviour"]["healthy"]["share"]["thesis"][0] == pytest.approx(
        1.0, abs=0.01
    )
    main(arguments)
    assert len(searched) == len(active_ceiling.FAULTS)
    assert json.loads((tmp_path / "out" / "results.json").read_text()) == first
    with pytest.raises(InputError, match="workers"):
        main(StimulusStudy((path,), tmp_path / "out", workers=0))
