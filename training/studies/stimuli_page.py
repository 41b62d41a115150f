"""The page of ``python -m training.studies.stimuli``, from its results alone."""

from collections.abc import Mapping
from typing import Any

from auv_fault_env.faults import fault_of
from training.report.cells import number, percent, row_name, with_interval
from training.report.sections import table_section
from training.stimuli.base import LARGEST_OFFSET
from training.stimuli.open_loop import Cruise, Thesis
from training.studies import stimuli_figures
from training.studies.stimulus_comparisons import (
    AGENT,
    REFERENCES,
    SUBSETS,
    Triple,
    rules_from_belief,
    speed_up,
)

Results = Mapping[str, Any]
MET = "met"
MISSED = "not met"
OPEN = "not judged"
NO_RATE = "no rate to compare with"
COLUMNS = ["isolation [s]", *(f"× {name}" for name in REFERENCES), "isolated"]
COLUMNS += [f"minus {name} [s]" for name in REFERENCES]
# column and format by cost
COSTS = {
    "speed_rms": ("speed RMS [m/s]", ".4f"),
    "energy": ("energy [J]", ".0f"),
    "false_alarms_per_hour": ("false alarms per hour", ".2f"),
}
COST_COLUMNS = [column for column, _ in COSTS.values()]
SUBSET_WORDS = {"all": "", "confounded": ", classes alike in cruise"}
# targets, as shares of the isolation time under the thesis' stimulus and in cruise, of the budget
OF_THESIS = 1 / 2
OF_CRUISE = 1 / 3
OF_BUDGET = 1 / 10


def page(results: Results) -> dict[str, Any]:
    """Title, introduction, command and sections; details are on the page only, not printed."""
    budgets = results["budgets"]
    summaries = [benchmarks(results), targets(results)]
    summaries += [cross_play(results, budget) for budget in budgets]
    details = [
        *(
            diagnoser_table(results, budget, diagnoser, subset)
            for budget in budgets
            for diagnoser in budgets[budget]["figures"]
            for subset in SUBSETS
        ),
        stimuli_figures.by_class(results),
        stimuli_figures.delay_cost_plane(results),
        stimuli_figures.around_onset(results),
        *(known_onset(results, budget) for budget in budgets),
        healthy(results),
        stimuli_figures.episodes(results),
        *(ceilings(results, budget) for budget in budgets),
    ]
    return {
        "title": "What the stimuli achieve",
        "summary": summary(results),
        "intro": introduction(results),
        "command": results["command"],
        "sections": [
            *summaries,
            *(section | {"printed": False} for section in details),
        ],
    }


def summary(results: Results) -> list[str]:
    """The soonest stimulus of each budget, and how many targets the agent meets."""
    suite = results["suite"]
    sentences = [
        f"Speed stimuli were compared on {suite['episodes']} episodes of the suite "
        f"{suite['name']}, at equal budgets of offset."
    ]
    for budget, of_budget in results["budgets"].items():
        figures = of_budget["figures"][results["diagnoser"]]["all"]
        best = _by_mean(figures)[0]
        judged = [row[1] for row in verdicts(of_budget, results["diagnoser"]) if row[1] != OPEN]
        n_met = judged.count(MET)
        sentences.append(
            f"Within {budget} m/s, {best} isolates soonest: {_triple_cell(figures[best]['mean'])} "
            f"s with {results['diagnoser']}, {_triple_cell(figures[Cruise.name]['mean'])} s in "
            f"cruise. The agent meets {n_met} of {len(judged)} targets."
        )
    return sentences


def introduction(results: Results) -> list[str]:
    """How to read the page."""
    suite = results["suite"]
    isolation = (
        f"Speed stimuli on {suite['episodes']} episodes of the suite {suite['name']}, the same for "
        "every stimulus and diagnoser. All keep the same budget, the root mean square of the speed "
        "offsets over an episode. Isolation times are restricted means at one false alarm per "
        "hour. Each diagnoser has its own threshold, the same under every stimulus. Faults that "
        "are not isolated in time count with the horizon."
    )
    intervals = (
        "Intervals are 95 % paired bootstrap intervals over episodes. "
        f"'{AGENT}' is the mean over the training seeds of the agent; its intervals resample the "
        "seeds as well and are rather too short, because the seeds are few. Ratios below 1 and "
        "negative differences favour the row."
    )
    return [isolation, intervals]


def benchmarks(results: Results) -> dict[str, Any]:
    """The benchmarks behind the results."""
    suite = results["suite"]
    share = "all" if suite["every"] == 1 else f"one in {suite['every']}"
    rows = []
    for budget, of_budget in results["budgets"].items():
        stimuli = ", ".join(of_budget["stimuli"])
        revision = of_budget["revision"] or "unknown"
        rows.append([f"{budget} m/s", stimuli, revision, of_budget["command"]])
    text = f"Suite {suite['name']}, {share} of its episodes, hash {suite['hash']}."
    columns = ["budget", "stimuli", "revision", "benchmark"]
    return table_section("What was compared", columns, rows, text)


def targets(results: Results) -> dict[str, Any]:
    """Which targets the agent meets."""
    rows = [
        [f"{budget} m/s", *row]
        for budget, of_budget in results["budgets"].items()
        for row in verdicts(of_budget, results["diagnoser"])
    ]
    text = (
        f"Targets of '{AGENT}' with {results['diagnoser']}. A target is met if the whole interval "
        f"is below it. Classes alike in cruise: {', '.join(SUBSETS['confounded'])}."
    )
    columns = ["budget", "target", "verdict", "figure"]
    return table_section("Does the agent meet its targets?", columns, rows, text)


def verdicts(of_budget: Mapping[str, Any], diagnoser: str) -> list[list[str]]:
    """Rows of the targets within a budget: target, verdict, and the figure with its interval.

    A target is met if the whole interval of the figure is below it.

    Parameters
    ----------
    of_budget
        Results of one budget, see `training.studies.stimuli`.
    diagnoser
        The one whose isolation times count.
    """
    subsets = of_budget["figures"][diagnoser]
    agent = {subset: figures[AGENT] for subset, figures in subsets.items() if AGENT in figures}

    def triple(subset: str, quantity: str, reference: str) -> Triple | None:
        return agent[subset][quantity][reference] if subset in agent else None

    of_thesis = f"isolates in less than half of the time under {Thesis.name}"
    of_cruise = f"classes alike in cruise: in less than a third of the time under {Cruise.name}"
    of_budget_words = "healthy vehicles: offsets below a tenth of the budget, root mean square"
    share = of_budget["behaviour"]["healthy"]["share"].get(AGENT)
    rows = [_verdict_row(of_thesis, triple("all", "ratio", Thesis.name), OF_THESIS)]
    for rule in rules_from_belief(subsets["all"]):
        difference = triple("all", "difference", rule)
        rows.append(_verdict_row(f"isolates sooner than under {rule}", difference, 0.0, "s", "+"))
    rows.append(_verdict_row(of_cruise, triple("confounded", "ratio", Cruise.name), OF_CRUISE))
    rows.append(_verdict_row(of_budget_words, share, OF_BUDGET))
    return rows


def _verdict_row(
    target: str,
    triple: Triple | None,
    limit: float,
    unit: str = "times",
    sign: str = "",
) -> list[str]:
    if not triple:
        return [target, OPEN, "The agent did not take part."]
    verdict = MET if triple[2] < limit else MISSED
    return [target, verdict, f"{_triple_cell(triple, sign)} {unit}"]


def cross_play(results: Results, budget: str) -> dict[str, Any]:
    """Every stimulus with every diagnoser."""
    figures = results["budgets"][budget]["figures"]
    rows = []
    for stimulus in _by_mean(figures[results["diagnoser"]]["all"]):
        means = [subsets["all"][stimulus]["mean"] for subsets in figures.values()]
        rows.append([stimulus, *map(_triple_cell, means)])
    names = [row_name(name, results["references"]) for name in figures]
    text = (
        "Isolation time, restricted mean [s]. The agent was trained with "
        f"{results['diagnoser']} alone. Diagnosers marked * are references: they know the truth, "
        "or nothing."
    )
    heading = f"Every stimulus with every diagnoser, {budget} m/s"
    return table_section(heading, ["stimulus", *names], rows, text)


def diagnoser_table(results: Results, budget: str, diagnoser: str, subset: str) -> dict[str, Any]:
    """The stimuli with one diagnoser, over all classes (with costs) or a subset."""
    of_budget = results["budgets"][budget]
    figures = of_budget["figures"][diagnoser].get(subset, {})
    heading = f"{diagnoser}, {budget} m/s{SUBSET_WORDS[subset]}"
    stimuli = _by_mean(figures)
    rows = []
    for stimulus in stimuli:
        spread = figures[stimulus]["spread"]
        name = stimulus if spread is None else f"{stimulus} ± {spread:.2f}"
        rows.append([name, *_figure_cells(figures[stimulus])])
    columns = ["stimulus", *COLUMNS]
    if subset != "all":
        return table_section(heading, columns, rows)
    for stimulus, row in zip(stimuli, rows, strict=True):
        costs = of_budget["costs"][diagnoser][stimulus]
        row += [format(costs[key], form) for key, (_, form) in COSTS.items()]
    text = (
        "After ± is the standard deviation over the training seeds [s]. Speed RMS is the root mean "
        "square deviation of the true speed from the mission speed."
    )
    return table_section(heading, [*columns, *COST_COLUMNS], rows, text)


def _by_mean(figures: Mapping[str, Any]) -> list[str]:
    """Stimuli by their mean isolation time."""
    return sorted(figures, key=lambda stimulus: figures[stimulus]["mean"][0])


def _triple_cell(triple: Triple, sign: str = "") -> str:
    return with_interval(triple[0], triple[1:], 2, sign)


def _figure_cells(figure: Mapping[str, Any]) -> list[str]:
    return [
        _triple_cell(figure["mean"]),
        *(_triple_cell(figure["ratio"][name]) for name in REFERENCES),
        percent(figure["isolated"]),
        *(_triple_cell(figure["difference"][name], "+") for name in REFERENCES),
    ]


def known_onset(results: Results, budget: str) -> dict[str, Any]:
    """What a known onset would achieve."""
    figures = results["budgets"][budget]["behaviour"]["known_onset"]
    rows = [[name, *_figure_cells(figures[name])] for name in _by_mean(figures)]
    text = (
        f"Faults of hull and propellers, {results['lanes']} vehicles of each class, with "
        f"{results['diagnoser']}. With the onset known the vehicle goes {LARGEST_OFFSET} m/s "
        "faster from then on until the allowance is spent, or without budget to the end. A "
        "stimulus that waits for suspicion begins later. Another speed profile may achieve more; "
        "see the ceilings below."
    )
    heading = f"What a known onset would achieve, {budget} m/s"
    return table_section(heading, ["stimulus", *COLUMNS], rows, text)


def healthy(results: Results) -> dict[str, Any]:
    """How much of the budget stimuli use on healthy vehicles."""
    budgets = results["budgets"]
    by_budget = {budget: budgets[budget]["behaviour"]["healthy"] for budget in budgets}
    names = dict.fromkeys(name for measured in by_budget.values() for name in measured["share"])
    rows = []
    for name in names:
        shares = [measured["share"].get(name) for measured in by_budget.values()]
        rows.append([name, *(_triple_cell(share) if share else "–" for share in shares)])
    n_lanes = next(iter(by_budget.values()))["lanes"]
    text = (
        "Root mean square of the speed offsets as a share of the budget, over "
        f"{n_lanes} healthy vehicles and 65 s, with {results['diagnoser']}."
    )
    columns = ["stimulus", *(f"{budget} m/s" for budget in by_budget)]
    return table_section("What they use on healthy vehicles", columns, rows, text)


def ceilings(results: Results, budget: str) -> dict[str, Any]:
    """How much a stimulus could achieve, beside what the agent achieves."""
    of_budget = results["budgets"][budget]
    figures = of_budget["figures"][results["diagnoser"]]
    rows = [
        [
            fault,
            f"{ceiling['passive']:.2g} ({ceiling['passive_rival']})",
            *(f"{ceiling[key]:.2g}" for key in ("thesis", "active", "free")),
            *(number(ceiling[key], 1, NO_RATE) for key in ("best_speed_up", "thesis_speed_up")),
            *(_agent_cell(figures, fault, reference) for reference in reversed(REFERENCES)),
        ]
        for fault, ceiling in of_budget["ceilings"].items()
    ]
    columns = [
        "fault",
        "cruise [nat/s] (rival)",
        "thesis [nat/s]",
        "best periodic",
        "best free",
    ]
    columns += [
        "D*/D cruise",
        "D*/D thesis",
        "agent: × sooner than cruise",
        "than thesis",
    ]
    rates = (
        "Rates at which evidence against the most dangerous rival grows, with the vehicle known: "
        "in cruise at 1 ft/s, under the thesis' stimulus, and under the best profile of the "
        "search, periodic or free (15 levels of one second, repeated). D* is the larger rate of "
        "the last two; its ratio to the others is the largest speed-up of the search. The search "
        "is short, and more may be possible."
    )
    agent = (
        "The last columns show what the agent gains in the benchmark, in mean isolation time of "
        "the class: over other severities and speeds, with ramps and the time to the alarm, and "
        "with a diagnoser that does not know the vehicle. Both need not agree; where the first is "
        "large and the second is not, training can improve the agent."
    )
    heading = f"How much a stimulus could achieve, {budget} m/s"
    return table_section(heading, columns, rows, rates, agent)


def _agent_cell(figures: Mapping[str, Any], fault: str, reference: str) -> str:
    of_class = figures.get(fault_of(fault).diagnosis, {})
    if AGENT not in of_class:
        return "–"
    return _triple_cell(speed_up(of_class[AGENT]["ratio"][reference]))
