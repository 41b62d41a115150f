"""The page of `auv-fault benchmark`, from its results alone: what was run, who is best, how far to trust that."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from training.benchmark import page_figures as figures
from training.benchmark.bounds import FEWEST, check
from training.benchmark.leaderboard import (
    ALARMS,
    alarm_cells,
    compute,
    in_order,
    leaderboard,
    left_out,
)
from training.benchmark.page_figures import BenchmarkView
from training.benchmark.verdicts import ByLane, difference
from training.metrics import Times
from training.report.cells import number, row_name, with_interval

CLOSEST = 8  # comparisons with a bound that are shown where none is beaten


def page(results: Mapping[str, Any]) -> dict[str, Any]:
    """Title, intro, command and sections for `report.write_report`; results as `training.benchmark.scores` tells."""
    view = BenchmarkView.of(results)
    sections = [
        what_was_run(view),
        *(main_table(view, stimulus) for stimulus in view.scores),
        *([left_out(results["failures"])] if results["failures"] else []),
        best_two(view),
        figures.isolation_over_time(view),
        figures.alarms_against_delay(view),
        *([against_bounds(view)] if view.bounds else []),
        figures.f1_over_time(view),
        *figures.by_class(view),
        *(bounds(stimulus, found) for stimulus, found in view.bounds.items()),
        figures.confusions(view),
        figures.costs(view),
        false_alarms(view),
        figures.calibration(view),
        figures.severity(view),
        compute_and_weights(view),
        compatibility(view),
        figures.worst(view),
    ]
    title = f"Diagnosers on the suite {results['suite']['name']}"
    return {
        "title": title,
        "intro": intro(view),
        "command": results["command"],
        "sections": sections,
    }


def intro(view: BenchmarkView) -> list[str]:
    """How to read the page."""
    settings = view.results["settings"]
    return [
        f"The suite: {view.results['suite']['about'].rstrip('.')}. {len(view.results['episodes']['seed'])} episodes "
        f"with a fault, the same for every diagnoser and stimulus. Stimuli: {', '.join(view.scores)}.",
        f"An alarm is p(normal) below a threshold for {settings['persistence']} samples in a row. Each diagnoser has "
        "one threshold for each rate of false alarms, whatever the stimulus, set on "
        f"{settings['hours']:g} h of healthy operation; false alarms are counted on other hours. Where no rate is "
        "named it is one per hour. Isolated means: alarm on and the right class on top, from then on until "
        f"{view.horizon:g} s after onset. Faults not isolated by then count with {view.horizon:g} s. Intervals are "
        "95 % bootstrap intervals over episodes.",
        "References, marked *, are not ranked: those that are told the true healthy parameters and severities, as the "
        "oracle is, and null and random, which anchor the scale: one never alarms, the other does so by chance at the "
        "rate set, so both isolate at the horizon and score as if all were called normal.",
    ]


def what_was_run(view: BenchmarkView) -> dict[str, Any]:
    """Suite, seeds, settings and versions."""
    results = view.results
    suite = results["suite"]
    settings = results["settings"]
    share = "all" if suite["every"] == 1 else f"one in {suite['every']}"
    rows = {
        "suite": f"{suite['name']}, {share} of {suite['listed']} episodes of {suite['duration']:g} s",
        "hash of the suite": suite["hash"],
        "plant": _listed(suite["plant"]),
        "stimuli": ", ".join(settings["stimuli"])
        + f" (budget {max(settings['stimuli'].values()):.4g} m/s)",
        "healthy operation": f"{settings['hours']:g} h for the thresholds, {settings['counting_hours']:g} h to count "
        "false alarms, of each diagnoser and all stimuli together",
        "seeds": ", ".join(f"{part} {_range(seeds)}" for part, seeds in results["seeds"].items()),
        "versions": _listed(results["versions"]),
        "revision": results["revision"] or "unknown",
        **{f"third party: {name}": place for name, place in results["third_parties"].items()},
    }
    return {
        "heading": "What was run",
        "text": [],
        "table": {"columns": ["what", "which"], "rows": [list(item) for item in rows.items()]},
    }


def _listed(values: Mapping[str, Any]) -> str:
    shown = {
        name: f"{value:.3g}" if isinstance(value, float) else value
        for name, value in values.items()
    }
    return ", ".join(f"{name} {value}" for name, value in shown.items())


def _range(seeds: Any) -> str:
    return f"{seeds[0]}–{seeds[1]}" if isinstance(seeds, list) else str(seeds)


def main_table(view: BenchmarkView, stimulus: str) -> dict[str, Any]:
    """The leaderboard under a stimulus, with the bound on mean delays as its last row."""
    section = leaderboard(view.scores[stimulus], view.references, f"Leaderboard under {stimulus}")
    if stimulus != next(iter(view.scores)):
        section["text"] = []  # what the columns are has been said
    if stimulus in view.bounds:
        section["text"] += ["The bound is that of abrupt faults; ramps only take longer."]
        least = {what: delay["1 h"] for what, delay in view.bounds[stimulus]["all"].items()}
        isolation = with_interval(least["isolation_delay"][0], least["isolation_delay"][1:], 2)
        cells = ["bound", isolation, "", "", f"{least['detection_delay'][0]:.2f}"]
        section["table"]["rows"].append(
            cells + [""] * (len(section["table"]["columns"]) - len(cells))
        )
    return section


def best_two(view: BenchmarkView) -> dict[str, Any]:
    """The best against the next best that competes, on the same episodes."""
    rows = []
    for stimulus, scores in view.scores.items():
        two = in_order(
            {name: score for name, score in scores.items() if name not in view.references}, ()
        )[:2]
        if len(two) == 2:
            by = difference(
                *(_by_lane(view, stimulus, name) for name in two),
                view.results["seeds"]["bootstrap"],
            )
            differences = with_interval(by.isolation[0], by.isolation[1:], 2, "+")
            f1 = with_interval(by.macro_f1[0], by.macro_f1[1:], 3, "+")
            rows.append([stimulus, *two, differences, f1, "yes" if by.better else "no"])
    return {
        "heading": "Is the best one better?",
        "text": [
            "The best by isolation time minus the next on the same episodes, with 95 % paired bootstrap intervals; "
            "negative times and positive macro-F1 are in its favour. Better means: on both, zero outside the intervals."
        ],
        "table": {
            "columns": ["stimulus", "best", "next", "isolation time [s]", "macro-F1", "better"],
            "rows": rows,
        },
    }


def _by_lane(view: BenchmarkView, stimulus: str, name: str) -> ByLane:
    lanes = view.scores[stimulus][name]["by_lane"]
    isolation = Times(np.array(lanes["isolation"], float), ~np.array(lanes["isolated"], bool))
    return ByLane(
        isolation, np.array(view.results["decided"][stimulus]), np.array(lanes["decision"])
    )


def against_bounds(view: BenchmarkView) -> dict[str, Any]:
    """The report's own check that nobody is better than anybody can be."""
    checks = check(view.results)
    beaten = [row for row in checks if row["beaten"]]
    near = sorted(checks, key=lambda row: row["measured"][0] - row["bound"][0])
    verdict = (
        f"{len(beaten)} of {len(checks)} comparisons beat their bound by more than the sampling intervals"
        + (
            ": something is wrong with them, or with the bound."
            if beaten
            else "; the closest are shown."
        )
    )
    return {
        "heading": "Does any diagnoser beat a bound?",
        "text": [
            f"{verdict} Mean delays of abrupt faults against the least that any diagnoser can have: of detection, by "
            f"class where there are {FEWEST} episodes, if it has no more false alarms and is told the vehicle and the "
            "severity; of isolation, over all classes, if it is told the vehicle, but not the severity."
        ],
        "table": {
            "columns": [
                "stimulus",
                "diagnoser",
                "what",
                "class",
                "measured [s]",
                "bound [s]",
                "beaten",
            ],
            "rows": [_check_cells(view, row) for row in beaten or near[:CLOSEST]],
        },
    }


def bounds(stimulus: str, found: Mapping[str, Any]) -> dict[str, Any]:
    """How soon any diagnoser could detect and isolate each class."""
    rates = list(found["all"]["detection_delay"])
    ratios = found["calibration"]["inverse_ratio"]
    shares = found["calibration"]["healthy_beyond"]
    inverse = ", ".join(f"{value:.2f} after {time}" for time, value in ratios.items())
    beyond = ", ".join(f"{share:.3f} beyond 1/{level}" for level, share in shares.items())
    return {
        "heading": f"Bounds under {stimulus}",
        "text": [
            "The least mean delays [s] of abrupt faults for any diagnoser, told the vehicle and the severity. "
            "Detection: with no more than one false alarm in the time named. Isolation: with at most one confusion in "
            "a hundred of the rival, the class that looks most alike, whose severity is not told; who confuses them "
            "more often may be sooner. log(γ)/I is asymptotic, for rare false alarms, and may be beaten. From "
            f"{found['lanes']} episodes. The likelihood ratios come from Kalman filters and are not quite that: their "
            f"mean inverse is {inverse} (exact: 1; above it, bounds may be too high), and of healthy "
            f"vehicles' ratios {beyond} (exact: at most the level)."
        ],
        "table": {
            "columns": [
                *("class", "information [nat/s]"),
                f"log(γ)/I, {rates[0]}",
                *(f"detection, {rate}" for rate in rates),
                *("rival", "apart [nat/s]", "isolation"),
            ],
            "rows": [
                _bound_cells(name, of_class, rates) for name, of_class in found["classes"].items()
            ],
        },
    }


def _bound_cells(name: str, of_class: Mapping[str, Any], rates: Sequence[str]) -> list[str]:
    detection = of_class["detection_delay"]
    isolation = of_class["isolation_delay"]
    return [
        name,
        f"{of_class['information_rate']:.3g}",
        f"{of_class['asymptotic_delay'][rates[0]]:.2f}",
        with_interval(detection[rates[0]][0], detection[rates[0]][1:], 2),
        *(f"{detection[rate][0]:.2f}" for rate in rates[1:]),
        of_class["rival"],
        f"{of_class['rival_rate']:.3g}",
        with_interval(isolation[0], isolation[1:], 2),
    ]


def _check_cells(view: BenchmarkView, row: Mapping[str, Any]) -> list[str]:
    delays = [with_interval(row[key][0], row[key][1:], 2) for key in ("measured", "bound")]
    name = row_name(row["diagnoser"], view.references)
    return [
        row["stimulus"],
        name,
        row["what"],
        row["class"],
        *delays,
        "yes" if row["beaten"] else "no",
    ]


def false_alarms(view: BenchmarkView) -> dict[str, Any]:
    """Thresholds and the false alarms counted, for each rate they are set for."""
    rows = [
        [
            row_name(name, view.references),
            stimulus,
            rate,
            *alarm_cells(score, 3600.0 * float(rate.split()[0])),
        ]
        for name in view.names
        for stimulus, scores in view.scores.items()
        for rate, score in scores[name]["rates"].items()
    ]
    return {
        "heading": "False alarms",
        "text": [
            "Counted on healthy vehicles that did not serve to set the threshold, per stimulus; the aim is one per "
            "time in the third column. The interval is that of the count (Poisson). The threshold rests on few alarms "
            "itself, and is the same under every stimulus, so that a rate may lie above the aim under one and below it "
            "under another. 'As set' says whether the interval holds the aim."
        ],
        "table": {"columns": ["diagnoser", "stimulus", "one per", *ALARMS], "rows": rows},
    }


def compute_and_weights(view: BenchmarkView) -> dict[str, Any]:
    """What an update costs, and which weights were run."""
    section = compute(view.results["compute"], view.names, view.references)
    section["table"]["columns"] += ["learnt numbers", "digest of the weights"]
    for name, row in zip(view.names, section["table"]["rows"], strict=True):
        digest = view.results["weights"][name]
        row += [
            f"{view.results['compute'][name]['numbers']:,}",
            digest[:16] if digest else "nothing learnt",
        ]
    return section


def compatibility(view: BenchmarkView) -> dict[str, Any]:
    """The scores of other benchmarks."""
    columns = list(next(iter(next(iter(view.scores.values())).values()))["compatibility"])
    silence = 0.5 - 0.5 / (len(view.results["classes"]) - 1)
    rows = [
        [row_name(name, view.references), stimulus]
        + [number(scores[name]["compatibility"][column], 3, "–") for column in columns]
        for name in view.names
        for stimulus, scores in view.scores.items()
    ]
    return {
        "heading": "Scores of other benchmarks",
        "text": [
            "The same decisions, alarms set for one false alarm per hour, as fddbenchmark, the DX 2025 competition and "
            "DXC'26 score them; training/compatibility.py has definitions and how they mislead. FAR counts samples, "
            f"not alarms; a diagnoser that never alarms has an m_utl of {silence:.3f}."
        ],
        "table": {"columns": ["diagnoser", "stimulus", *columns], "rows": rows},
    }
