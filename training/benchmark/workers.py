"""Trials run in parallel by processes, threads or machines; each outcome is written as it comes."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env.errors import refusal
from auv_fault_env.faults import CATALOGUE, Fault
from training.benchmark import trial_store
from training.benchmark.failures import note_failure, one_line
from training.benchmark.own_process import call_in_own_process
from training.benchmark.third_parties import OwnProcess
from training.benchmark.trials import Entrant, FaultyOutcome, Trial, run_trial
from training.extras import import_from_extra
from training.metrics.records import HealthyOutcome

RAY = "ray"
JOBS_PER_ROUND = 256  # jobs that are waited for together


def check_backend(backend: str) -> None:
    """Register the backend `ray` with joblib; refuse it if it is not installed."""
    if backend != RAY:
        return
    import_from_extra("ray.util.joblib", "distributed", "`--backend ray`").register_ray()


def with_catalogue(
    faults: Mapping[str, Fault], function: Callable[..., Any], *arguments: Any
) -> Any:
    """The result of the function, once the catalogue of this process has these faults.

    A process of a pool starts with the catalogue that the package ships; the faults are those of
    the process that planned the work.
    """
    if faults != CATALOGUE:
        CATALOGUE.clear()
        CATALOGUE.update(faults)
    return function(*arguments)


def call_for(entrant: Entrant, function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of the function, in a process of its own if the entrant is foreign.

    The function runs code of the entrant. It returns plain data as JSON has it, or arrays by name.
    """
    maker = entrant.make
    if not isinstance(maker, OwnProcess):
        return function(*arguments)
    job = (with_catalogue, dict(CATALOGUE), function, *arguments)
    return call_in_own_process(*job, limit=maker.time_limit)


def outcome_arrays(trial: Trial) -> dict[str, np.ndarray]:
    """The outcome of a trial as arrays by name."""
    return run_trial(trial)._asdict()


def attempt(path: Path, trial: Trial) -> tuple[Path, str, FaultyOutcome | HealthyOutcome | str]:
    """Path, diagnoser, and the outcome or the reason why there is none."""
    try:
        arrays = call_for(trial.entrant, outcome_arrays, trial)
        return path, trial.entrant.name, trial_store.outcome_kind(trial.part)(**arrays)
    # whatever fails in one diagnoser, the others are scored
    except (Exception, SystemExit) as error:
        return path, trial.entrant.name, one_line(error)


def run_missing(trials: Mapping[Path, Trial], workers: int, backend: str) -> dict[str, str]:
    """Run the trials that have no outcome yet and write it; returns why diagnosers failed, by name.

    No more trials of a diagnoser begin after it has failed. One of the package that ends its whole
    process, or takes all memory, ends the run.
    """
    failures: dict[str, str] = {}
    faults = dict(CATALOGUE)
    missing = {path: trial for path, trial in trials.items() if not path.exists()}
    n_lanes = {path: len(trial.episodes) for path, trial in trials.items()}
    n_total = sum(n_lanes.values())
    n_missing = sum(n_lanes[path] for path in missing)
    jobs = (
        delayed(with_catalogue)(faults, attempt, path, trial)
        for path, trial in missing.items()
        if trial.entrant.name not in failures
    )
    n_done = n_total - n_missing
    with tqdm(total=n_total, initial=n_done, unit="lane", desc="trials", smoothing=0.05) as bar:
        for path, name, outcome in _outcomes(jobs, workers, backend):
            bar.update(n_lanes[path])
            bar.set_postfix_str(name)
            if not isinstance(outcome, str):
                trial_store.write(path, outcome)
            elif name not in failures:
                note_failure(failures, name, outcome)
    return failures


def _outcomes(jobs: Iterator[Any], workers: int, backend: str) -> Iterator[Any]:
    """The outcomes in any order: as they come, or in rounds where joblib waits for all."""
    if backend == RAY:
        with Parallel(n_jobs=workers, backend=backend) as parallel:
            while round_of_jobs := list(islice(jobs, JOBS_PER_ROUND)):
                yield from parallel(round_of_jobs)
        return
    parallel = Parallel(n_jobs=workers, backend=backend, return_as="generator_unordered")
    try:
        yield from parallel(jobs)
    except BrokenProcessPool:
        remedy = "take fewer --workers; what is done is kept"
        raise refusal("workers", "a process that has died", "enough memory", remedy) from None
