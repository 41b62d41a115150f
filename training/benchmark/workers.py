"""Trials spread over processes, threads or machines; each outcome is written as it comes."""

import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env.errors import refusal
from auv_fault_env.faults import CATALOGUE, Fault
from training.benchmark import trial_store
from training.benchmark.trials import FaultyOutcome, Trial, run_trial
from training.benchmark.validation import one_line
from training.metrics.records import HealthyOutcome

RAY = "ray"
ROUND = 256  # jobs that are waited for together


def check_backend(backend: str) -> None:
    """Make a backend known to joblib that is not by itself; one that is not installed is refused."""
    if backend != RAY:
        return
    try:
        from ray.util.joblib import register_ray
    except ImportError:
        raise refusal(
            "backend", backend, "an installed one", "pip install 'auv-fault[distributed]'"
        ) from None
    register_ray()


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


def attempt(path: Path, trial: Trial) -> tuple[Path, str, FaultyOutcome | HealthyOutcome | str]:
    """Where the trial's outcome belongs, its diagnoser, the outcome, or why there is none."""
    try:
        return path, trial.entrant.name, run_trial(trial)
    except (Exception, SystemExit) as error:  # whatever ails one diagnoser, the others are scored
        return path, trial.entrant.name, one_line(error)


def run_missing(trials: Mapping[Path, Trial], workers: int, backend: str) -> dict[str, str]:
    """Run the trials whose outcome is not there yet, and write it; says why diagnosers failed, by name.

    Of a diagnoser that has failed no more trials are begun. One that ends its whole process, or
    takes all memory, ends the run.
    """
    failures: dict[str, str] = {}
    faults = dict(CATALOGUE)
    todo = {path: trial for path, trial in trials.items() if not path.exists()}
    sizes = {path: len(trial.episodes) for path, trial in trials.items()}
    jobs = (
        delayed(with_catalogue)(faults, attempt, path, trial)
        for path, trial in todo.items()
        if trial.entrant.name not in failures
    )
    done = sum(sizes.values()) - sum(map(sizes.get, todo))
    with tqdm(
        total=sum(sizes.values()), initial=done, unit="lane", desc="trials", smoothing=0.05
    ) as bar:
        for path, name, outcome in _outcomes(jobs, workers, backend):
            bar.update(sizes[path])
            bar.set_postfix_str(name)
            if not isinstance(outcome, str):
                trial_store.write(path, outcome)
            elif name not in failures:
                failures[name] = outcome
                tqdm.write(f"{name} is left out: {outcome}", file=sys.stderr)
    return failures


def _outcomes(jobs: Iterator[Any], workers: int, backend: str) -> Iterator[Any]:
    """What comes of the jobs, in any order: one by one as they end, or in rounds where joblib can only wait for all."""
    if backend != RAY:
        try:
            yield from Parallel(n_jobs=workers, backend=backend, return_as="generator_unordered")(
                jobs
            )
        except BrokenProcessPool:
            remedy = (
                "take fewer --workers, or leave out the diagnoser at fault; what is done is kept"
            )
            raise refusal(
                "workers", "a process that has died", "enough memory, sound diagnosers", remedy
            ) from None
        return
    with Parallel(n_jobs=workers, backend=backend) as parallel:
        while round_of_jobs := list(islice(jobs, ROUND)):
            yield from parallel(round_of_jobs)
