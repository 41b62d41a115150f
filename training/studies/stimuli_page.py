"""The page of ``python -m training.studies.stimuli``, from its results alone: targets, comparisons, behaviour."""

from collections.abc import Mapping
from typing import Any

from auv_fault_env.faults import fault_of
from training.report.cells import percent, row_name, with_interval
from training.stimuli.base import LARGEST_OFFSET
from training.studies import stimuli_figures as drawn
from training.studies.stimulus_comparisons import AGENT, REFERENCES, SUBSETS, Triple, speed_up
from training.studies.stimulus_verdicts import verdicts

Results = Mapping[str, Any]
COLUMNS = ["isolation [s]", *(f"× {name}" for name in REFERENCES), "isolated"]
COLUMNS += [f"minus {name} [s]" for name in REFERENCES]
WHICH = {"all": "", "confounded": ", classes alike in cruise"}


def page(results: Results) -> dict[str, Any]:
    """Title, introduction, command and sections for `report.write_report`."""
    budgets = results["budgets"]
    sections = [
        compared(results),
        targets(results),
        *(cross_play(results, budget) for budget in budgets),
    ]
    details = [
        *(
            table(results, budget, diagnoser, subset)
            for budget in budgets
            for diagnoser in budgets[budget]["figures"]
            for subset in SUBSETS
        ),
        drawn.by_class(results),
        drawn.plane(results),
        drawn.onset(results),
        *(told(results, budget) for budget in budgets),
        healthy(results),
        drawn.episodes(results),
        *(ceiling(results, budget) for budget in budgets),
    ]
    return {
        "title": "What the stimuli bring",
        "intro": intro(results),
        "command": results["command"],
        "sections": [*sections, *(section | {"printed": False} for section in details)],
    }


def intro(results: Results) -> list[str]:
    """How to read the page."""
    return [
        f"Stimuli of the speed on the {results['suite']['episodes']} episodes of the suite {results['suite']['name']} "
        "that were run, the same for every stimulus and diagnoser, each within the same budget: the root mean square "
        "of the speed offsets over an episode. Isolation times are restricted means at one false alarm per hour, the "
        "threshold being a diagnoser's own and the same under every stimulus; faults that are not isolated in time "
        "count with the horizon.",
        f"Intervals are 95 % paired bootstrap intervals over episodes. '{AGENT}' is the mean over the seeds that the "
        "agent was trained with, and its intervals draw the seeds anew as well; as these are few, they are "
        "rather too short. Ratios below 1 and negative differences are in favour of the row.",
    ]


def compared(results: Results) -> dict[str, Any]:
    """Which benchmarks."""
    suite = results["suite"]
    share = "all" if suite["every"] == 1 else f"one in {suite['every']}"
    rows = [
        [f"{budget} m/s", ", ".join(one["stimuli"]), one["revision"] or "unknown", one["command"]]
        for budget, one in results["budgets"].items()
    ]
    return {
        "heading": "What was compared",
        "text": [f"Suite {suite['name']}, {share} of its episodes, hash {suite['hash']}."],
        "table": {"columns": ["budget", "stimuli", "revision", "benchmark"], "rows": rows},
    }


def targets(results: Results) -> dict[str, Any]:
    """Which targets are met."""
    rows = [
        [f"{budget} m/s", *row]
        for budget, of_budget in results["budgets"].items()
        for row in verdicts(of_budget, results["diagnoser"])
    ]
    return {
        "heading": "Is the agent as good as it should be?",
        "text": [
            f"Targets of '{AGENT}', beside {results['diagnoser']}. One is met if the whole interval says so. Classes "
            f"alike in cruise: {', '.join(SUBSETS['confounded'])}."
        ],
        "table": {"columns": ["budget", "target", "verdict", "figure"], "rows": rows},
    }


def cross_play(results: Results, budget: str) -> dict[str, Any]:
    """Every stimulus with every diagnoser."""
    figures = results["budgets"][budget]["figures"]
    rows = [
        [
            stimulus,
            *(_triple(of_diagnoser["all"][stimulus]["mean"]) for of_diagnoser in figures.values()),
        ]
        for stimulus in _ordered(figures[results["diagnoser"]]["all"])
    ]
    names = [row_name(name, results["references"]) for name in figures]
    return {
        "heading": f"Every stimulus with every diagnoser, {budget} m/s",
        "text": [
            f"Isolation time, restricted mean [s]. The agent has learnt beside {results['diagnoser']} alone. "
            "Diagnosers marked * are references: told the truth, or knowing nothing."
        ],
        "table": {"columns": ["stimulus", *names], "rows": rows},
    }


def table(results: Results, budget: str, diagnoser: str, subset: str) -> dict[str, Any]:
    """The stimuli with one diagnoser, over all classes or some of them."""
    of_budget = results["budgets"][budget]
    figures = of_budget["figures"][diagnoser].get(subset, {})
    cost = of_budget["costs"][diagnoser]
    columns = ["stimulus", *COLUMNS]
    columns += ["speed RMS [m/s]", "energy [J]", "false alarms per hour"] if subset == "all" else []
    rows = [
        [_named(stimulus, figures[stimulus]), *_cells(figures[stimulus])]
        + (_cost_cells(cost[stimulus]) if subset == "all" else [])
        for stimulus in _ordered(figures)
    ]
    text = "After ± the standard deviation over the seeds [s]. Speed RMS is that of the true speed from the mission's."
    return {
        "heading": f"{diagnoser}, {budget} m/s{WHICH[subset]}",
        "text": [text] if subset == "all" else [],
        "table": {"columns": columns, "rows": rows},
    }


def _ordered(figures: Mapping[str, Any]) -> list[str]:
    return sorted(figures, key=lambda stimulus: figures[stimulus]["mean"][0])


def _named(stimulus: str, figure: Mapping[str, Any]) -> str:
    return stimulus if figure["spread"] is None else f"{stimulus} ± {figure['spread']:.2f}"


def _triple(triple: Triple, sign: str = "") -> str:
    return with_interval(triple[0], triple[1:], 2, sign)


def _cells(figure: Mapping[str, Any]) -> list[str]:
    return [
        _triple(figure["mean"]),
        *(_triple(figure["ratio"][name]) for name in REFERENCES),
        percent(figure["isolated"]),
        *(_triple(figure["difference"][name], "+") for name in REFERENCES),
    ]


def _cost_cells(cost: Mapping[str, float]) -> list[str]:
    return [
        f"{cost['speed_rms']:.4f}",
        f"{cost['energy']:.0f}",
        f"{cost['false_alarms_per_hour']:.2f}",
    ]


def told(results: Results, budget: str) -> dict[str, Any]:
    """What knowing the onset would bring."""
    figures = results["budgets"][budget]["behaviour"]["told"]
    rows = [[name, *_cells(figures[name])] for name in _ordered(figures)]
    return {
        "heading": f"What knowing the onset would bring, {budget} m/s",
        "text": [
            f"Faults of hull and propellers, {results['lanes']} vehicles of each class, {results['diagnoser']} in the "
            f"loop. Who is told the onset goes {LARGEST_OFFSET} m/s faster from then on until the allowance is spent, or "
            "without a budget to the end. A stimulus that waits for suspicion begins later. Another profile may bring "
            "more; see the ceilings below."
        ],
        "table": {"columns": ["stimulus", *COLUMNS], "rows": rows},
    }


def healthy(results: Results) -> dict[str, Any]:
    """What stimuli spend on healthy vehicles."""
    found = {budget: one["behaviour"]["healthy"] for budget, one in results["budgets"].items()}
    names = dict.fromkeys(name for one in found.values() for name in one["share"])
    rows = [
        [
            name,
            *(
                _triple(one["share"][name]) if name in one["share"] else "–"
                for one in found.values()
            ),
        ]
        for name in names
    ]
    return {
        "heading": "What they spend on healthy vehicles",
        "text": [
            "Root mean square of the speed offsets as a share of the budget, over "
            f"{next(iter(found.values()))['lanes']} healthy vehicles watched for 65 s, with "
            f"{results['diagnoser']} in the loop."
        ],
        "table": {"columns": ["stimulus", *(f"{budget} m/s" for budget in found)], "rows": rows},
    }


def ceiling(results: Results, budget: str) -> dict[str, Any]:
    """How much a stimulus could bring, beside what the agent does."""
    of_budget = results["budgets"][budget]
    figures = of_budget["figures"][results["diagnoser"]]
    rows = [
        [
            fault,
            f"{one['passive']:.2g} ({one['passive_rival']})",
            *(f"{one[key]:.2g}" for key in ("thesis", "active", "free")),
            *(_times(one[key]) for key in ("best_speed_up", "thesis_speed_up")),
            *(_measured(figures, fault, reference) for reference in reversed(REFERENCES)),
        ]
        for fault, one in of_budget["ceilings"].items()
    ]
    columns = ["fault", "cruise [nat/s] (rival)", "thesis [nat/s]", "best periodic", "best free"]
    columns += ["D*/D cruise", "D*/D thesis", "agent: × sooner than cruise", "than thesis"]
    return {
        "heading": f"How much a stimulus can bring, {budget} m/s",
        "text": [
            "Rates at which evidence against the most dangerous rival gathers, the vehicle known, in cruise at 1 ft/s, "
            "under the thesis' stimulus, and under the best profile found, periodic or free (15 levels of a second, "
            "repeated). D* is the larger of these two; its ratio to the others is the largest speed-up that was found. "
            "Beside it what the agent gains in the benchmark, in mean isolation time of the class: over other "
            "severities and speeds, ramps and the time to raise an alarm included, with a diagnoser that knows no "
            "vehicle. The two need not agree; where the first is large and the second is not, there is more to learn. "
            "The search is short, and more may be possible."
        ],
        "table": {"columns": columns, "rows": rows},
    }


def _times(ratio: float | None) -> str:
    return "no rate to compare with" if ratio is None else f"{ratio:.1f}"


def _measured(figures: Mapping[str, Any], fault: str, reference: str) -> str:
    of_class = figures.get(fault_of(fault).diagnosis, {})
    return _triple(speed_up(of_class[AGENT]["ratio"][reference])) if AGENT in of_class else "–"
