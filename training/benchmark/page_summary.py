"""The summary of the benchmark's page: who is best, at what price, and how far from the limit."""

from collections.abc import Mapping
from typing import Any

from training.benchmark.leaderboard import ORACLE, in_order
from training.benchmark.page_figures import BenchmarkView
from training.benchmark.scores import RANKED_AT, Score
from training.report.cells import percent, with_interval

FEW_EPISODES = 200  # below which the summary warns


def summary(view: BenchmarkView) -> list[str]:
    """What was run, the best two diagnosers, their false alarms, and the distance to the limit."""
    n_episodes = len(view.results["episodes"]["seed"])
    n_references = len(view.references & set(view.names))
    sentences = [
        f"{len(view.ranked)} diagnosers and {n_references} references on {n_episodes} episodes "
        f"with a fault of the suite {view.results['suite']['name']}, under "
        f"{' and '.join(view.scores)}."
    ]
    if view.ranked:
        best = view.ranked[0]
        stimulus = view.best_stimulus(best)
        scores = view.scores[stimulus]
        sentences += [_best(scores, best, stimulus, view), _false_alarms(scores[best], best)]
        if ORACLE in scores:
            sentences.append(_distance(scores, best))
    if n_episodes < FEW_EPISODES:
        sentences.append(
            f"With {n_episodes} episodes the intervals are wide, and the order may be chance."
        )
    return sentences


def _best(scores: Mapping[str, Score], best: str, stimulus: str, view: BenchmarkView) -> str:
    competing = [name for name in in_order(scores, view.references) if name in view.ranked]
    others = [name for name in competing if name != best]
    then = f"; next is {others[0]} with {_time(scores[others[0]])}" if others else ""
    share = percent(scores[best]["isolation"]["probability"])
    return (
        f"{best} is best: under {stimulus} it isolates {share} of the faults, in "
        f"{_time(scores[best])} on average{then}."
    )


def _time(score: Score) -> str:
    isolation = score["isolation"]
    return f"{with_interval(isolation['restricted_mean'], isolation['interval'], 1)} s"


def _false_alarms(score: Score, name: str) -> str:
    rate: Mapping[str, Any] = score["rates"][RANKED_AT]
    alarms = with_interval(rate["false_alarms_per_hour"], rate["false_alarms_per_hour_interval"], 1)
    kept = "as set" if rate["rate_as_set"] else "not as set"
    return f"{name} raised {alarms} false alarms per hour, where 1 is the aim: {kept}."


def _distance(scores: Mapping[str, Score], best: str) -> str:
    ratio = (
        scores[best]["isolation"]["restricted_mean"]
        / scores[ORACLE]["isolation"]["restricted_mean"]
    )
    return (
        f"That is {ratio:.2f} times the time of the oracle, which knows vehicle and severity: "
        "a diagnoser that knows neither can hardly be better than that."
    )
