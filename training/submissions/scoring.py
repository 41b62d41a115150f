"""The scores of a submission on its suite."""

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.compiling import digest
from auv_fault_env.errors import InputError
from diagnosers.checks import check_beliefs
from training.benchmark import score_series, timing, trial_store
from training.benchmark.assessment import Assessment
from training.benchmark.failures import CallFailed, one_line
from training.benchmark.own_process import call_in_own_process
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.preparation import TIMED
from training.benchmark.scores import (
    ScoreInputs,
    TrialOutcomes,
    assess_at_rates,
    macro_f1,
    macro_f1_interval,
)
from training.benchmark.third_parties import OwnProcess, Party
from training.benchmark.trials import COUNTING, FAULTY, THRESHOLD, Entrant, Trial, lane_truth
from training.benchmark.workers import run_missing
from training.metrics import Times, naming
from training.metrics.intervals import Interval, interval, poisson_interval
from training.seeds import seeds

BACKEND = "loky"
BOOTSTRAP_SEED = 0


class Figure(NamedTuple):
    """A number with its 95 % interval."""

    value: float
    interval: Interval


class Examined(NamedTuple):
    """What is known of a submission before the trials."""

    name: str
    update: dict[str, float]  # microseconds: p50_us, p99_us, many_lanes_us


def examine(party: Party, time_limit: float) -> Examined:
    """Name and cost of a submission; refused if it breaks a rule of diagnosers."""
    first_seed = seeds("test", 1, TIMED)[0]
    try:
        answer = call_in_own_process(_examined, party, first_seed, limit=time_limit)
    except CallFailed as error:
        raise _failed(party, str(error)) from None
    return Examined(**answer)


def _examined(party: Any, first_seed: int) -> dict[str, Any]:
    name = party.name
    diagnoser = party()
    if hasattr(diagnoser, "set_truth"):
        raise InputError("it asks for the truth, which no submission gets: take out `set_truth`")
    check_beliefs(diagnoser)
    return {"name": name, "update": timing.compute_cost(diagnoser, first_seed)}


def _failed(party: Party, reason: str) -> InputError:
    copied = getattr(party, "folder", None)
    if copied is not None:
        reason = reason.replace(f"{copied}{os.sep}", "")
    return InputError(f"submission {party.target}: {reason}")


def figures(
    plan: BenchmarkPlan, name: str, party: Party, time_limit: float, workers: int
) -> dict[str, Figure]:
    """The figures of a submission, by the keys of `FIGURES`; refused if it fails."""
    entrant = Entrant(name, OwnProcess(party, time_limit))
    trials = plan.trials([entrant])
    with tempfile.TemporaryDirectory() as folder:
        paths = {Path(folder) / f"{k}{trial_store.ENDING}": one for k, one in enumerate(trials)}
        failures = run_missing(paths, workers, BACKEND)
        if failures:
            raise _failed(party, failures[name])
        inputs = _inputs(plan, paths)
    try:
        return {key: compute(inputs) for key, compute in FIGURES.items()}
    except (ValueError, FloatingPointError) as error:
        raise _failed(party, one_line(error)) from None


def _inputs(plan: BenchmarkPlan, paths: Mapping[Path, Trial]) -> ScoreInputs:
    of_part = {
        part: trial_store.read([path for path, trial in paths.items() if trial.part == part], part)
        for part in (THRESHOLD, COUNTING, FAULTY)
    }
    outcomes = TrialOutcomes(of_part[THRESHOLD], of_part[COUNTING], of_part[FAULTY], None)
    truth = lane_truth(plan.suite.conditions, plan.faulty_episodes)
    return ScoreInputs(assess_at_rates(outcomes, truth), truth, outcomes, [], BOOTSTRAP_SEED)


def _mean(values: np.ndarray, seed: int) -> Figure:
    """Mean of values (n_lanes,) with its bootstrap interval."""
    numbers = values.astype(np.float64)
    return Figure(float(numbers.mean()), interval(numbers, seed))


def _time(times: Callable[[Assessment], Times]) -> Callable[[ScoreInputs], Figure]:
    return lambda inputs: _mean(times(inputs.ranked).time, inputs.seed)


def _share(times: Callable[[Assessment], Times]) -> Callable[[ScoreInputs], Figure]:
    return lambda inputs: _mean(~times(inputs.ranked).censored, inputs.seed)


def _declared(kind: str) -> Callable[[ScoreInputs], Figure]:
    def share(inputs: ScoreInputs) -> Figure:
        unknown = naming.unknown_class()
        declarations, _ = score_series.judged(inputs.outcomes.faulty, inputs.truth, unknown)
        return _mean(getattr(declarations, kind), inputs.seed)

    return share


def _false_alarms(inputs: ScoreInputs) -> Figure:
    counted = inputs.ranked
    rate = counted.false_alarms / counted.hours
    return Figure(rate, poisson_interval(counted.false_alarms, counted.hours))


def _macro_f1(inputs: ScoreInputs) -> Figure:
    return Figure(macro_f1(inputs.ranked), macro_f1_interval(inputs))


# As the benchmark has them, at the threshold for one false alarm per hour.
FIGURES: dict[str, Callable[[ScoreInputs], Figure]] = {
    "isolation": _time(lambda ranked: ranked.isolation),
    "isolated": _share(lambda ranked: ranked.isolation),
    "detection": _time(lambda ranked: ranked.detection),
    "detected": _share(lambda ranked: ranked.detection),
    "false_alarms_per_hour": _false_alarms,
    "declared_right": _declared("right"),
    "declared_wrong": _declared("wrong"),
    "abstained": _declared("abstained"),
    "macro_f1": _macro_f1,
}


def scoring_code() -> str:
    """Digest of the source of the scoring, of simulator and metrics: all that it imports."""
    return digest(Path(__file__).resolve())
