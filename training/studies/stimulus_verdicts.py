"""Are the agent's targets met? Each as one row: target, verdict, the figure with its 95 % interval."""

from collections.abc import Mapping
from typing import Any

from training.benchmark.verdicts import MET, MISSED, OPEN
from training.report.cells import with_interval
from training.stimuli.open_loop import Cruise, Thesis
from training.studies.stimulus_comparisons import AGENT, Triple, rivals

# what is aimed at, as shares
OF_THESIS = 1 / 2
OF_CRUISE = 1 / 3
OF_BUDGET = 1 / 10


def verdicts(of_budget: Mapping[str, Any], diagnoser: str) -> list[list[str]]:
    """Rows of the targets within a budget, beside a diagnoser; results as `training.studies.stimuli` tells.

    A target is met if the whole interval of the figure is on the right side.
    """
    subsets = of_budget["figures"][diagnoser]
    agent = {name: figures[AGENT] for name, figures in subsets.items() if AGENT in figures}
    share = of_budget["behaviour"]["healthy"]["share"].get(AGENT)
    return [
        _row(
            f"isolates in less than half of the time under {Thesis.name}",
            _ratio(agent, "all", Thesis.name),
            OF_THESIS,
        ),
        *(
            _row(
                f"isolates sooner than under {name}",
                agent and agent["all"]["difference"][name],
                0.0,
                "s",
                "+",
            )
            for name in rivals(subsets["all"])
        ),
        _row(
            f"classes alike in cruise: in less than a third of the time under {Cruise.name}",
            _ratio(agent, "confounded", Cruise.name),
            OF_CRUISE,
        ),
        _row(
            "healthy vehicles: offsets below a tenth of the budget, root mean square",
            share,
            OF_BUDGET,
        ),
    ]


def _ratio(agent: Mapping[str, Any], subset: str, reference: str) -> Triple | None:
    return agent[subset]["ratio"][reference] if subset in agent else None


def _row(
    target: str, found: Triple | None, limit: float, unit: str = "times", sign: str = ""
) -> list[str]:
    if not found:
        return [target, OPEN, "The agent did not take part."]
    value, low, high = found
    return [
        target,
        MET if high < limit else MISSED,
        f"{with_interval(value, (low, high), 2, sign)} {unit}",
    ]
