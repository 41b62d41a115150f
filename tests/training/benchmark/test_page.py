"""The page is made from plain results, says what they say, and every figure of it can be drawn."""

import copy
import json

import numpy as np
import pytest

from auv_fault_env.faults import classes
from training.benchmark import leaderboard
from training.benchmark import page as benchmark_page
from training.report.figures import registry
from training.report.page import write_report

N_EPISODES = 144
N_HEALTHY = 36
HORIZON = 30.0
NAMES = ("integrated", "filter_bank", "cusum", "mine", "oracle", "null")
STIMULI = ("cruise", "thesis")
RATES = {"1 h": 3600.0, "10 h": 36000.0}
READINGS = (
    "speed",
    "speed_command",
    "port_rpm",
    "starboard_rpm",
    "port_current",
    "starboard_current",
)
FAULT = np.arange(N_EPISODES) % (len(classes()) - 2) + 1
DECIDED = np.concatenate([FAULT, np.zeros(N_HEALTHY, int)])


def times(values):
    mean = float(np.mean(values))
    seen = values < HORIZON
    median = float(np.median(values))
    return {
        "restricted_mean": mean,
        "interval": [mean - 0.5, mean + 0.5],
        "probability": float(seen.mean()),
        "median": median if median < HORIZON else None,
    }


def worst_episode(random, k):
    time = np.arange(0.0, 65.0, 0.5)
    slope = -np.clip(time - 20.0, 0.0, None) * random.uniform(0.0, 2.0)
    return {
        "seed": 4_000_000_000 + k,
        "class": int(FAULT[k]),
        "severity": 0.25,
        "onset": 20.0,
        "isolation": None,
        "why": "never isolated: sensor:starboard_current named instead for most of the time",
        "time": time.tolist(),
        "log_normal": (slope - 0.01).tolist(),
        "threshold": -6.0,
        "alarm": (slope < -6.0).tolist(),
        "fault": np.where(time > 40.0, FAULT[k], 3).tolist(),
        "readings": {
            name: (1.0 + 0.2 * np.sin(time / 3 + i)).tolist() for i, name in enumerate(READINGS)
        },
    }


def at_rate(mean_time, isolation, detection):
    return {
        "threshold": -6.0 - np.log10(mean_time),
        "false_alarms": 49,
        "false_alarm_vehicles": 45,
        "hours": 50.0,
        "false_alarms_per_hour": 0.98,
        "false_alarms_per_hour_interval": [0.73, 1.3],
        "rate_as_set": mean_time == 3600.0,
        "time_in_alarm": 0.004,
        "false_alarms_by_age": {
            "from": [0.0, 1.0, 120.0],
            "to": [1.0, 120.0, None],
            "alarms": [9, 40, 0],
            "hours": [10.0, 39.0, 1.0],
            "per_hour_interval": [[0.4, 1.7], [0.7, 1.4], [0.0, 3.7]],
        },
        "false_alarms_by_quarter": {
            "alarms": [10, 12, 13, 14],
            "hours": 12.5,
            "per_hour_interval": [[0.4, 1.5]] * 4,
        },
        "isolation": times(isolation),
        "detection": times(detection),
        "isolation_by_onset": {"abrupt": times(isolation), "ramped": None},
        "detection_by_onset": {"abrupt": times(detection), "ramped": times(detection)},
    }


def score(skill, stimulus, seed):
    """Made up of a skill from 0 (null) to 1."""
    random = np.random.default_rng(seed)
    isolation = np.minimum(
        random.exponential(3.0 / max(skill, 1e-6) ** 2, N_EPISODES) + 0.3, HORIZON
    )
    detection = 0.7 * isolation if skill else isolation
    decision = np.where(
        random.uniform(size=DECIDED.size) < skill,
        DECIDED,
        random.integers(0, len(classes()), DECIDED.size),
    )
    rates = np.geomspace(0.03, 60.0, 40)
    matrix = np.zeros((len(classes()), len(classes())), int)
    np.add.at(matrix, (DECIDED, decision), 1)
    truth = random.uniform(0.2, 1.0, 60)
    confidence = np.linspace(0.1, 0.95, 9)
    of_fault = {name: isolation[k == FAULT] for k, name in enumerate(classes()) if k in FAULT}
    mean = {name: float(times.mean()) for name, times in of_fault.items()}
    by_rate = {rate: at_rate(mean_time, isolation, detection) for rate, mean_time in RATES.items()}
    return {
        "rates": by_rate,
        **by_rate["1 h"],
        "abstention": {
            "area": 0.1 - 0.1 * skill,
            "risk": 1.0 - skill,
            "coverage": [0.5, 1.0],
            "risk_at": [0.5 - 0.5 * skill, 1.0 - skill],
        },
        "declared": {
            "right": skill,
            "wrong": 0.5 - 0.5 * skill,
            "unknown": 0.0,
            "never": 0.5 - 0.5 * skill,
            "time_to_right": 30.0 - 25.0 * skill,
            "time_to_right_interval": [29.0 - 25.0 * skill, 30.5 - 25.0 * skill],
        },
        "naming": {
            "lanes": 40,
            "alarmed": skill,
            "right": 0.7,
            "unknown": 0.4,
            "surely_wrong": 0.05 if skill else None,
        },
        "isolation_by_class": mean,
        "detection_by_class": {name: 0.7 * value for name, value in mean.items()},
        "macro_f1": 0.9 * skill,
        "macro_f1_interval": [0.85 * skill, 0.95 * skill],
        "macro_f1_over_time": [0.9 * skill * t / (t + 2) for t in (1, 2, 5, 10, 20)],
        "severity_mae": 0.3 - 0.25 * skill,
        "severity_mae_interval": [0.29 - 0.25 * skill, 0.31 - 0.25 * skill],
        "severity_coverage": 0.88,
        "ece": 0.02,
        "brier": 0.3,
        "log_loss": None if skill < 0.5 else 0.6,
        "cost": {
            "speed_rms": 0.02 if stimulus == "cruise" else 0.0762,
            "energy": 185.0 if stimulus == "cruise" else 220.0,
            "speed_rms_ratio": 1.0 if stimulus == "cruise" else 3.81,
            "energy_ratio": 1.0 if stimulus == "cruise" else 1.19,
        },
        "isolation_over_time": {
            "time": np.linspace(0, 30, 61).tolist(),
            "share": [float((isolation <= t).mean()) for t in np.linspace(0, 29.9, 61)],
        },
        "amoc": {
            "false_alarms_per_hour": rates.tolist(),
            "delay": (detection.mean() * (60.0 / rates) ** (0.1 * (skill > 0)) / 1.5)
            .clip(0, HORIZON)
            .tolist(),
            "probability": (1 - 0.1 * (60.0 / rates) ** 0.1).tolist(),
        },
        "confusion": matrix.tolist(),
        "reliability": {
            "share": [1 / 9] * 9,
            "confidence": confidence.tolist(),
            "accuracy": (confidence**1.1).tolist(),
        },
        "severity_scatter": {
            "truth": truth.tolist(),
            "estimate": (truth + random.normal(0, 0.1, 60)).clip(0, 1).tolist(),
        },
        "compatibility": {
            "fddbenchmark TPR": 0.9 * skill,
            "DX'25 FAR": 0.01,
            "DX'25 FIA": None if not skill else 0.8,
        },
        "by_lane": {
            "isolation": isolation.tolist(),
            "isolated": (isolation < HORIZON).tolist(),
            "detection": detection.tolist(),
            "detected": (detection < HORIZON).tolist(),
            "decision": decision.tolist(),
        },
        "worst": [worst_episode(random, k) for k in range(3)],
    }


def bound(least):
    interval = [least, 0.9 * least, 1.1 * least]
    of_class = {
        "information_rate": 2.5,
        "asymptotic_delay": {"1 h": 2.1, "10 h": 2.6},
        "detection_delay": {"1 h": interval, "10 h": interval},
        "delay_by_rate": [least] * 10,
        "rival": "sensor:speed",
        "rival_rate": 0.8,
        "isolation_delay": interval,
        "asymptotic_isolation": 3.0,
        "isolation_attained": interval,
    }
    return {
        "classes": dict.fromkeys(classes()[1:-1], of_class),
        "all": {
            key: {"1 h": interval, "10 h": interval}
            for key in ("detection_delay", "isolation_delay")
        }
        | {"isolation_attained": interval},
        "amoc": {
            "false_alarms_per_hour": np.geomspace(0.03, 60, 10).tolist(),
            "delay": [least] * 10,
        },
        "calibration": {
            "inverse_ratio": {"1 s": 0.98, "15 s": 0.7},
            "healthy_beyond": {"0.01": 0.008, "0.1": 0.06},
        },
        "lanes": 360,
    }


def made_up(stimuli=STIMULI, names=NAMES, least=None):
    """Results as `training.benchmark.results.RESULTS` has them, of skills that fall with the place
    of the name.
    """
    skills = dict(zip(names, (0.97, 0.9, 0.7, 0.5, 1.0, 0.0), strict=False))
    results = {
        "command": "auv-fault benchmark --suite standard",
        "suite": {
            "name": "standard",
            "about": "Every class, every severity.",
            "hash": "ab" * 32,
            "plant": {
                "preset": "thesis1992",
                "sensor_noise": 1.0,
                "disturbance": 1.0,
                "healthy_band": 1.0,
            },
            "duration": 65.0,
            "listed": 2052,
            "every": 1,
        },
        "seeds": {
            "faulty": [10, 153],
            "threshold": [100, 200],
            "counting": [300, 400],
            "bootstrap": 0,
        },
        "settings": {
            "persistence": 3,
            "horizon": HORIZON,
            "decided_at": [1.0, 2.0, 5.0, 10.0, 20.0],
            "severity_at": 20.0,
            "hours": 200.0,
            "counting_hours": 50.0,
            "stimuli": dict.fromkeys(stimuli, 0.0762),
        },
        "classes": list(classes()),
        "references": [name for name in names if name in ("oracle", "null")],
        "third_parties": {"mine": "/somewhere/mine.py:Mine"} if "mine" in names else {},
        "failures": {"rules": "RuntimeError: no idea"},
        "versions": {"python": "3.11.2", "numpy": "2.4.6"},
        "revision": None,
        "weights": {name: "0123456789abcdef" if name == "integrated" else None for name in names},
        "compute": {
            name: {"p50_us": 41.0, "p99_us": 99.5, "many_lanes_us": 1.23, "numbers": 12345}
            for name in names
        },
        "episodes": {
            "seed": list(range(N_EPISODES)),
            "fault": FAULT.tolist(),
            "onset": [20.0] * N_EPISODES,
            "severity": [0.6] * N_EPISODES,
            "ramp": [0.0] * N_EPISODES,
            "abrupt": [True] * N_EPISODES,
        },
        "decided": {stimulus: DECIDED.tolist() for stimulus in stimuli},
        "scores": {
            stimulus: {name: score(skill, stimulus, seed) for name, skill in skills.items()}
            for seed, stimulus in enumerate(stimuli)
        },
    }
    return (
        results
        if least is None
        else results | {"bounds": {stimulus: bound(least) for stimulus in stimuli}}
    )


@pytest.fixture(scope="module")
def results():
    return json.loads(json.dumps(made_up(least=0.25), allow_nan=False))


@pytest.fixture(scope="module")
def page(results):
    return benchmark_page.page(results)


def table(page, heading):
    (found,) = [section["table"] for section in page["sections"] if section["heading"] == heading]
    assert {len(row) for row in found["rows"]} == {len(found["columns"])}
    assert all(isinstance(cell, str) for row in found["rows"] for cell in row)
    return found


def rows(page, heading):
    return table(page, heading)["rows"]


def test_every_table_has_a_text_for_every_column(page):
    for section in page["sections"]:
        if "table" in section:
            table(page, section["heading"])


def test_leaderboard_is_in_order_and_ends_with_the_bound(page):
    names = [row[0] for row in rows(page, "Leaderboard under thesis")]
    assert names == [
        "integrated",
        "filter_bank",
        "cusum",
        "mine",
        "oracle *",
        "null *",
        "bound",
        "knows vehicle and onset",
    ]
    assert rows(page, "Leaderboard under thesis")[-2][1] == "0.25 (0.23–0.28)"


@pytest.mark.parametrize(("names", "last"), [(NAMES, True), (("cusum", "null"), False)])
def test_only_beside_the_oracle_times_are_compared_with_it(names, last):
    found = benchmark_page.page(made_up(stimuli=("thesis",), names=names))
    columns = table(found, "Leaderboard under thesis")["columns"]
    assert (columns[-1] == "× oracle") == last


def test_alarms_by_age_have_a_column_for_every_age(page):
    found = table(page, "Do false alarms grow with the age of the mission?")
    assert found["columns"][3:6] == [
        "per hour, 0–1 min",
        "per hour, 1–120 min",
        "per hour, from 120 min",
    ]
    assert found["rows"][0][3:] == [
        "0.90 (0.40–1.70)",
        "1.03 (0.70–1.40)",
        "0.00 (0.00–3.70)",
        "10, 12, 13, 14",
    ]


def test_names_of_unexplained_faults_are_shown_where_there_are_such(results):
    heading = "What are faults called that no class describes?"
    assert rows(benchmark_page.page(results), heading)[-1][-1] == "–"
    known = copy.deepcopy(results)
    for scores in known["scores"].values():
        for of_score in scores.values():
            of_score["naming"] = None
    headings = [section["heading"] for section in benchmark_page.page(known)["sections"]]
    assert heading not in headings


def test_what_was_run_says_suite_seeds_and_third_parties(page):
    said = dict(rows(page, "What was run"))
    assert said["suite"] == "standard, all of 2052 episodes of 65 s"
    assert said["hash of the suite"] == "ab" * 32
    assert "faulty 10–153" in said["seeds"] and "bootstrap 0" in said["seeds"]
    assert said["third party: mine"] == "/somewhere/mine.py:Mine"
    assert said["revision"] == "unknown"
    assert rows(page, "Left out") == [["rules", "RuntimeError: no idea"]]
    digests = {row[0]: row[-1] for row in rows(page, "Compute")}
    assert digests["integrated"] == "0123456789abcdef" and digests["oracle *"] == "no weights"


def test_the_summary_says_who_is_best_at_what_price_and_how_far_from_the_limit(page):
    what, best, price, distance, warning = page["summary"]
    assert what.startswith("4 diagnosers and 2 references on 144 episodes")
    assert best.startswith("integrated is best: under thesis it isolates 100 % of the faults, in ")
    assert "next is filter_bank with " in best
    assert price.endswith("false alarms per hour, where 1 is the aim: as set.")
    assert distance.startswith("That is 1.06 times the time of the oracle")
    assert "order may be chance" in warning


def test_without_the_oracle_no_distance_is_said():
    summary = benchmark_page.page(made_up(names=("cusum", "null")))["summary"]
    assert not any("oracle" in sentence for sentence in summary)
    assert not any("next is" in sentence for sentence in summary)


def test_the_introduction_reads_as_sentences(page):
    assert page["intro"][0].startswith(
        "The suite: Every class, every severity. It has 144 episodes with a fault"
    )


def test_the_bound_of_isolation_says_for_whom_it_holds(page):
    (section,) = [
        section for section in page["sections"] if section["heading"] == "Isolation time by class"
    ]
    assert next(iter(section["figures"][0]["data"]["delays"])) == "bound at 1 % confused"
    assert (
        "A diagnoser that confuses the two more often can be below it"
        in section["figures"][0]["caption"]
    )


def test_long_durations_are_written_in_full():
    costs = {"a": {"p50_us": 41.04, "p99_us": 4843.2, "many_lanes_us": 1.234}}
    assert leaderboard.compute_table(costs, ["a"], ())["table"]["rows"] == [
        ["a", "41", "4,843", "1.23"]
    ]


def test_a_shortened_run_says_so(results):
    short = results | {"suite": results["suite"] | {"every": 4}}
    assert "one in 4 of 2052" in dict(rows(benchmark_page.page(short), "What was run"))["suite"]


def test_false_alarms_are_flagged_at_both_rates(page):
    flags = {tuple(row[:3]): row[-1] for row in rows(page, "False alarms")}
    assert len(flags) == len(NAMES) * len(STIMULI) * len(RATES)
    assert flags["cusum", "thesis", "1 h"] == "yes"
    assert flags["cusum", "thesis", "10 h"] == "no, more"  # 0.98 per hour where 0.1 is the aim


def test_the_best_two_are_compared_in_pairs(page):
    compared = rows(page, "Is the best one better?")
    assert [row[:3] for row in compared] == [
        [stimulus, "integrated", "filter_bank"] for stimulus in STIMULI
    ]
    assert compared[0][3].startswith("-")


def test_a_bound_that_holds_and_one_that_is_beaten(results, page):
    (verdict,) = [
        section for section in page["sections"] if section["heading"].startswith("Does any")
    ]
    n_checks = (
        len(STIMULI) * len(NAMES) * (len(classes()) - 1)
    )  # detection of each fault, isolation of all
    assert verdict["text"][0].startswith(f"0 of {n_checks} comparisons beat their bound")
    assert {row[-1] for row in verdict["table"]["rows"]} == {"no"}
    impossible = results | {"bounds": {stimulus: bound(29.0) for stimulus in STIMULI}}
    beaten = rows(benchmark_page.page(impossible), "Does any diagnoser beat a bound?")
    assert {row[-1] for row in beaten} == {"yes"}
    assert "null *" not in {row[1] for row in beaten}  # nobody's delay is above the bound


def test_without_bounds_nothing_is_said_of_them(results):
    bare = benchmark_page.page({key: value for key, value in results.items() if key != "bounds"})
    assert not [section["heading"] for section in bare["sections"] if "ound" in section["heading"]]
    assert rows(bare, "Leaderboard under cruise")[-1][0] == "null *"


@pytest.mark.parametrize("names", [("integrated",), ("oracle",), ("mine", "null")])
def test_any_set_of_diagnosers_makes_a_page(names):
    found = benchmark_page.page(made_up(stimuli=("thesis",), names=names))
    for section in found["sections"]:
        for figure in section.get("figures", ()):
            registry.draw(figure["plot"], figure["data"])


def test_a_score_that_is_none_is_written(page):
    assert "infinite" in [row[9] for row in rows(page, "Leaderboard under cruise")]
    assert ["null *", "cruise", "0.000", "0.010", "–"] in rows(page, "Scores of other benchmarks")


def test_results_stay_as_they_are(results):
    before = copy.deepcopy(results)
    benchmark_page.page(results)
    assert results == before


@pytest.mark.slow
def test_the_report_has_every_figure(tmp_path):
    page = benchmark_page.page(
        made_up(stimuli=("thesis",), names=("integrated", "null"), least=0.25)
    )
    write_report(page, tmp_path)
    names = [
        figure["name"] for section in page["sections"] for figure in section.get("figures", ())
    ]
    assert len(names) == len(set(names)) == 13
    assert {path.stem for path in (tmp_path / "figures").iterdir()} == set(names)
    text = (tmp_path / "index.html").read_text()
    assert text.count("<img") == len(names)
    for word in (
        "Leaderboard under thesis",
        "Worst episodes",
        "auv-fault benchmark --suite standard",
        "bound",
    ):
        assert word in text
