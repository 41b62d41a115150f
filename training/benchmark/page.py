"""The page of a benchmark, from its results alone."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from training.benchmark import page_figures as figures
from training.benchmark import page_honesty as honesty
from training.benchmark.bounds import FEWEST, check
from training.benchmark.differences import LaneResults, difference
from training.benchmark.leaderboard import (
    ALARM_COLUMNS,
    alarm_cells,
    compute_table,
    failures_table,
    in_order,
    leaderboard,
)
from training.benchmark.page_figures import BenchmarkView
from training.benchmark.page_summary import summary
from training.benchmark.results import RESULTS
from training.benchmark.scores import MEAN_TIMES, METRICS, RANKED_AT, RATE_METRICS
from training.metrics import Times
from training.report.cells import number, row_name, with_interval
from training.report.sections import table_section

N_CLOSEST = 8  # comparisons with a bound that are shown where none is beaten


def page(results: Mapping[str, Any]) -> dict[str, Any]:
    """Title, intro, command and sections for `write_report`; `RESULTS` says what results hold."""
    view = BenchmarkView.of(results)
    failures = results["failures"]
    unexplained = honesty.naming(view)
    sections = [
        what_was_run(view),
        *(main_table(view, stimulus) for stimulus in view.scores),
        *([failures_table(failures)] if failures else []),
        best_two(view),
        figures.isolation_over_time(view),
        figures.alarms_against_delay(view),
        *([against_bounds(view)] if view.bounds else []),
        figures.f1_over_time(view),
        *figures.by_class(view),
        *(bounds(stimulus, of_stimulus) for stimulus, of_stimulus in view.bounds.items()),
        figures.confusions(view),
        figures.costs(view),
        false_alarms(view),
        honesty.alarms_by_age(view),
        honesty.abrupt_and_ramped(view),
        honesty.declared(view),
        honesty.abstention(view),
        *([unexplained] if unexplained else []),
        figures.calibration(view),
        figures.severity(view),
        compute_and_weights(view),
        compatibility(view),
        figures.worst(view),
        meanings(),
    ]
    return {
        "title": f"Diagnosers on the suite {results['suite']['name']}",
        "summary": summary(view),
        "intro": intro(view),
        "command": results["command"],
        "sections": sections,
    }


def intro(view: BenchmarkView) -> list[str]:
    """How to read the page."""
    results = view.results
    settings = results["settings"]
    horizon = f"{view.horizon:g} s"
    return [
        f"The suite: {results['suite']['about'].rstrip('.')}. It has "
        f"{len(results['episodes']['seed'])} episodes with a fault, the same for every diagnoser "
        f"and stimulus. Stimuli: {', '.join(view.scores)}.",
        "An alarm stands while p(normal) has been below a threshold for "
        f"{settings['persistence']} samples in a row. Each diagnoser has one threshold for each "
        "rate of false alarms, the same under every stimulus, set on "
        f"{settings['hours']:g} h of healthy operation; false alarms are counted on other hours. "
        "Figures are at one false alarm per hour unless another rate is named.",
        "A fault is isolated when an alarm stands with the right class as the most probable fault, "
        f"and both hold until {horizon} after onset. A fault that is not isolated by then counts "
        f"with {horizon}. The right class of a fault outside the catalogue is `unknown`, of two "
        "faults that of the worse one. Intervals are 95 % bootstrap intervals over episodes.",
        "Diagnosers marked * are references and are not ranked. The oracle, and any other that "
        "receives the truth, knows the healthy parameters and the severities. null never alarms "
        "and random alarms by chance at the rate set: both show the score of a diagnoser that "
        "reads nothing.",
    ]


def what_was_run(view: BenchmarkView) -> dict[str, Any]:
    """Suite, seeds, settings and versions."""
    results = view.results
    suite = results["suite"]
    settings = results["settings"]
    share = "all" if suite["every"] == 1 else f"one in {suite['every']}"
    budget = max(settings["stimuli"].values())
    seeds = [f"{part} {_seed_range(ends)}" for part, ends in results["seeds"].items()]
    rows = {
        "suite": f"{suite['name']}, {share} of {suite['listed']} episodes of "
        f"{suite['duration']:g} s",
        "hash of the suite": suite["hash"],
        "plant": _listed(suite["plant"]),
        "stimuli": f"{', '.join(settings['stimuli'])} (budget {budget:.4g} m/s)",
        "healthy operation": f"{settings['hours']:g} h for the thresholds, "
        f"{settings['counting_hours']:g} h to count false alarms, of each diagnoser, shared by "
        "the stimuli",
        "seeds": ", ".join(seeds),
        "versions": _listed(results["versions"]),
        "revision": results["revision"] or "unknown",
    }
    for name, origin in results["third_parties"].items():
        rows[f"third party: {name}"] = origin
    return table_section("What was run", ["item", "value"], [list(item) for item in rows.items()])


def _listed(values: Mapping[str, Any]) -> str:
    texts = []
    for name, value in values.items():
        shown = f"{value:.3g}" if isinstance(value, float) else value
        texts.append(f"{name} {shown}")
    return ", ".join(texts)


def _seed_range(seeds: Any) -> str:
    return f"{seeds[0]}–{seeds[1]}" if isinstance(seeds, list) else str(seeds)


def main_table(view: BenchmarkView, stimulus: str) -> dict[str, Any]:
    """The leaderboard under a stimulus, with the bound on mean delays as its last row."""
    section = leaderboard(view.scores[stimulus], view.references, f"Leaderboard under {stimulus}")
    if stimulus != next(iter(view.scores)):
        section["text"] = []  # the first leaderboard explains the columns
    if stimulus not in view.bounds:
        return section
    section["text"] += [
        "The bound is that of abrupt faults; ramped faults take longer. Below it, what a filter "
        "bank attains on abrupt faults that knows the vehicle and the onset: the mean time until "
        "the most probable fault is right for good."
    ]
    bounds_of_all = view.bounds[stimulus]["all"]
    isolation, *isolation_interval = bounds_of_all["isolation_delay"][RANKED_AT]
    detection = bounds_of_all["detection_delay"][RANKED_AT][0]
    cells = {
        "diagnoser": "bound",
        "isolation, restricted mean [s]": with_interval(isolation, isolation_interval, 2),
        "detection, restricted mean [s]": f"{detection:.2f}",
    }
    table = section["table"]
    attained, *attained_interval = bounds_of_all["isolation_attained"]
    attained_cells = {
        "diagnoser": "knows vehicle and onset",
        "isolation, restricted mean [s]": with_interval(attained, attained_interval, 2),
    }
    for row in (cells, attained_cells):
        table["rows"].append([row.get(column, "") for column in table["columns"]])
    return section


def best_two(view: BenchmarkView) -> dict[str, Any]:
    """The best ranked diagnoser against the second on the same episodes."""
    rows = []
    for stimulus, scores in view.scores.items():
        competing = {name: of for name, of in scores.items() if name not in view.references}
        two = in_order(competing, ())[:2]
        if len(two) < 2:
            continue
        best, second = (_lane_results(view, stimulus, name) for name in two)
        paired = difference(best, second, view.results["seeds"]["bootstrap"])
        time = with_interval(paired.isolation[0], paired.isolation[1:], 2, "+")
        f1 = with_interval(paired.macro_f1[0], paired.macro_f1[1:], 3, "+")
        rows.append([stimulus, *two, time, f1, "yes" if paired.is_better else "no"])
    columns = [
        "stimulus",
        "best",
        "second",
        "isolation time [s]",
        "macro-F1",
        "better",
    ]
    return table_section(
        "Is the best one better?",
        columns,
        rows,
        "The best by isolation time minus the second on the same episodes, with 95 % paired "
        "bootstrap intervals. A negative time and a positive macro-F1 favour the best. It is "
        "better if neither interval contains zero.",
    )


def _lane_results(view: BenchmarkView, stimulus: str, name: str) -> LaneResults:
    lanes = view.scores[stimulus][name]["by_lane"]
    is_censored = ~np.array(lanes["isolated"], bool)
    return LaneResults(
        isolation=Times(np.array(lanes["isolation"], float), is_censored),
        label=np.array(view.results["decided"][stimulus]),
        decision=np.array(lanes["decision"]),
    )


def against_bounds(view: BenchmarkView) -> dict[str, Any]:
    """Whether any measured delay is below its bound."""
    comparisons = check(view.results)
    beaten = [row for row in comparisons if row["beaten"]]
    closest = sorted(comparisons, key=lambda row: row["measured"][0] - row["bound"][0])
    conclusion = "The closest are shown."
    if beaten:
        conclusion = "These comparisons, or the bound, are wrong."
    columns = [
        "stimulus",
        "diagnoser",
        "time",
        "class",
        "measured [s]",
        "bound [s]",
        "beaten",
    ]
    return table_section(
        "Does any diagnoser beat a bound?",
        columns,
        [_check_cells(view, row) for row in beaten or closest[:N_CLOSEST]],
        f"{len(beaten)} of {len(comparisons)} comparisons beat their bound by more than the "
        f"sampling intervals. {conclusion}",
        "Mean delays of abrupt faults against the least that any diagnoser can have. The bound "
        f"of detection is by class where there are {FEWEST} episodes, for a diagnoser with no "
        "more false alarms that knows the vehicle and the severity. The bound of isolation is "
        "over all classes, for one that knows the vehicle but not the severity.",
    )


def bounds(stimulus: str, of_stimulus: Mapping[str, Any]) -> dict[str, Any]:
    """How soon any diagnoser could detect and isolate each class."""
    rates = list(of_stimulus["all"]["detection_delay"])
    calibration = of_stimulus["calibration"]
    ratios = [f"{value:.2f} after {time}" for time, value in calibration["inverse_ratio"].items()]
    shares = [
        f"{share:.3f} beyond 1/{level}" for level, share in calibration["healthy_beyond"].items()
    ]
    rows = [_bound_cells(name, row, rates) for name, row in of_stimulus["classes"].items()]
    columns = ["class", "information [nat/s]", f"log(γ)/I, {rates[0]}"]
    columns += [f"detection, {rate}" for rate in rates]
    columns += ["rival", "apart [nat/s]", "isolation", "attained"]
    return table_section(
        f"Bounds under {stimulus}",
        columns,
        rows,
        "The least mean delays [s] of abrupt faults for any diagnoser that knows the vehicle "
        "and the severity. Detection: with no more than one false alarm in the time named. "
        "Isolation: against the rival, the class that looks most alike and whose severity is "
        "unknown, with at most one confusion in a hundred; a diagnoser that confuses them more "
        "often may be sooner. Attained: isolation for good by a filter bank that knows the "
        "vehicle and the onset but not the severity; other classes may keep it from being right "
        "longer than the rival alone. log(γ)/I holds for rare false alarms and may be beaten. From "
        f"{of_stimulus['lanes']} episodes.",
        "The likelihood ratios come from Kalman filters and are approximate. Their mean "
        f"inverse is {', '.join(ratios)} (exact: 1; above it, bounds may be too high). Shares "
        f"of healthy vehicles whose ratio is high: {', '.join(shares)} (exact: at most the level).",
    )


def _bound_cells(name: str, of_class: Mapping[str, Any], rates: Sequence[str]) -> list[str]:
    detection = of_class["detection_delay"]
    first, *first_interval = detection[rates[0]]
    isolation, *isolation_interval = of_class["isolation_delay"]
    return [
        name,
        f"{of_class['information_rate']:.3g}",
        f"{of_class['asymptotic_delay'][rates[0]]:.2f}",
        with_interval(first, first_interval, 2),
        *(f"{detection[rate][0]:.2f}" for rate in rates[1:]),
        of_class["rival"],
        f"{of_class['rival_rate']:.3g}",
        with_interval(isolation, isolation_interval, 2),
        f"{of_class['isolation_attained'][0]:.2f}",
    ]


def _check_cells(view: BenchmarkView, row: Mapping[str, Any]) -> list[str]:
    name = row_name(row["diagnoser"], view.references)
    measured = with_interval(row["measured"][0], row["measured"][1:], 2)
    bound = with_interval(row["bound"][0], row["bound"][1:], 2)
    beaten = "yes" if row["beaten"] else "no"
    return [row["stimulus"], name, row["what"], row["class"], measured, bound, beaten]


def false_alarms(view: BenchmarkView) -> dict[str, Any]:
    """Thresholds and the false alarms counted, for each rate that they are set for."""
    rows = []
    for name in view.names:
        for stimulus, scores in view.scores.items():
            for rate, score in scores[name]["rates"].items():
                start = [row_name(name, view.references), stimulus, rate]
                rows.append(start + alarm_cells(score, MEAN_TIMES[rate]))
    return table_section(
        "False alarms",
        ["diagnoser", "stimulus", "one per", *ALARM_COLUMNS],
        rows,
        "Counted by stimulus on healthy vehicles that did not serve to set the threshold. The "
        "aim is one false alarm in the time of the third column. The interval is that of the "
        "count (Poisson). The threshold rests on few alarms and is the same under every "
        "stimulus, so a rate may be above the aim under one stimulus and below it under "
        "another. 'As set' says whether the interval contains the aim.",
    )


def compute_and_weights(view: BenchmarkView) -> dict[str, Any]:
    """What an update costs, and which weights were run."""
    costs = view.results["compute"]
    section = compute_table(costs, view.names, view.references)
    section["table"]["columns"] += ["numbers in the weights", "digest of the weights"]
    for name, row in zip(view.names, section["table"]["rows"], strict=True):
        digest = view.results["weights"][name]
        row += [
            f"{costs[name]['numbers']:,}",
            digest[:16] if digest else "no weights",
        ]
    return section


def compatibility(view: BenchmarkView) -> dict[str, Any]:
    """The scores of other benchmarks."""
    first_scores = next(iter(view.scores.values()))
    columns = list(next(iter(first_scores.values()))["compatibility"])
    silent_utility = 0.5 - 0.5 / (len(view.results["classes"]) - 2)
    rows = []
    for name in view.names:
        for stimulus, scores in view.scores.items():
            values = scores[name]["compatibility"]
            cells = [number(values[column], 3, "–") for column in columns]
            rows.append([row_name(name, view.references), stimulus, *cells])
    return table_section(
        "Scores of other benchmarks",
        ["diagnoser", "stimulus", *columns],
        rows,
        "The same decisions, at one false alarm per hour, scored as fddbenchmark, the DX 2025 "
        "competition and DXC'26 score them; training/metrics/compatibility.py defines the "
        "scores and says how they mislead. FAR counts samples, not alarms. A diagnoser that "
        f"never alarms has an m_utl of {silent_utility:.3f} on faults that have a class.",
    )


def meanings() -> dict[str, Any]:
    """What results.json holds, and how each metric misleads."""
    rows = [[key, meaning, ""] for key, meaning in RESULTS.items()]
    rows += [[f"scores: {one.key}", one.meaning, one.misleads] for one in METRICS]
    rows += [[f"rates: {one.key}", one.meaning, one.misleads] for one in RATE_METRICS]
    return table_section(
        "What results.json holds",
        ["key", "meaning", "how it misleads"],
        rows,
        "Every figure of this page is made from results.json beside it; results.csv has the main "
        "figures as a table. Intervals are [low, high].",
    )
