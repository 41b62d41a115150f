"""``auv-fault benchmark``: diagnosers and stimuli on a frozen suite, scored at set rates of false alarms."""

import functools
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range, known_name, refusal, whole_number
from diagnosers import NAMES, make
from diagnosers.third_party import load_third_parties
from training.arguments import Benchmark
from training.benchmark import timing, trial_store
from training.benchmark.page import page
from training.benchmark.plan import MOST_HOURS, BenchmarkPlan
from training.benchmark.results import PreparedEntrant, bounds, header, scored, write_csv
from training.benchmark.suites import STANDARD, load
from training.benchmark.trials import COUNTING, THRESHOLD, Entrant
from training.benchmark.validation import Contestant, note_failure
from training.benchmark.workers import check_backend, run_missing
from training.report.page import print_tables, write_report
from training.report.run_folder import (
    checked_output,
    read_manifest,
    run_folder,
    write_json,
    write_manifest,
)
from training.seeds import seeds
from training.stimuli import STIMULI
from training.stimuli.closed_loop import ClosedLoop

TRIALS = "trials"
LAST_SEED = 10_000_000  # of bootstraps, and from which the seeds of the bounds' lanes are counted
ALL_CORES = -1  # as joblib has it
TIMED = 950_000_000  # first test seed of the episodes that the timing runs on


def main(arguments: Benchmark) -> None:
    """Run what has not been run yet, score it, and write report, figures and results."""
    plan = _plan(arguments)
    entrants = _entrants(arguments)
    workers = ALL_CORES if arguments.workers is None else whole_number("workers", arguments.workers)
    check_backend(arguments.backend)
    output = arguments.output or Path("runs") / f"benchmark-{plan.suite.name}"
    suite = {"suite": plan.suite.name, "hash": plan.suite.hash}
    folder = opened(output, arguments, suite)
    try:
        results = _results(arguments, plan, entrants, folder, workers)
        report = page(results)
        with run_folder(output, "benchmark", arguments, suite, files_to_keep=[TRIALS]) as aside:
            write_json(aside / "results.json", results)
            write_csv(aside / "results.csv", results)
            write_report(report, aside)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            "the trials that are done are kept, and the same command goes on from there"
        ) from None
    print_tables(report["sections"][: 1 + len(plan.stimuli)])  # what was run, and the leaderboards
    print(f"\nreport: {output / 'index.html'}")


def _results(
    arguments: Benchmark,
    plan: BenchmarkPlan,
    entrants: Mapping[str, Entrant],
    folder: Path,
    workers: int,
) -> dict[str, Any]:
    """All results, from trials that are run if they are not in the folder."""
    made, failures = _made(entrants)
    trials = plan.trials([one.entrant for one in made.values()])
    paths = {
        trial_store.path_of(folder, one, made[one.entrant.name].fingerprint): one for one in trials
    }
    failures |= run_missing(paths, workers, arguments.backend)
    paths = {path: trial for path, trial in paths.items() if trial.entrant.name not in failures}
    scores = scored(plan, paths, arguments.seed, failures)
    working = {name: one for name, one in made.items() if name not in failures}
    if not working:
        raise refusal(
            "diagnosers", list(entrants), "at least one that works", "see above what ails them"
        )
    results = header(arguments, plan, working, failures) | scores
    # the bounds are those of its faults, whoever watches
    if plan.suite == load(STANDARD) and plan.every == 1:
        without_belief = [one for one in plan.stimuli if not isinstance(one, ClosedLoop)]
        results["bounds"] = bounds(without_belief, arguments.seed, workers, arguments.backend)
    return results


def _plan(arguments: Benchmark) -> BenchmarkPlan:
    suite = load(arguments.suite)
    names = dict.fromkeys(known_name("stimulus", name, STIMULI) for name in arguments.stimuli)
    stimuli = [STIMULI[name](arguments.budget) for name in names]
    if not stimuli:
        raise refusal("stimuli", arguments.stimuli, f"some of {', '.join(STIMULI)}", "name one")
    hours = {THRESHOLD: arguments.hours, COUNTING: arguments.counting_hours}
    for name, value in hours.items():
        finite_in_range(f"hours of the part {name}", value, 0.05, MOST_HOURS)
    finite_in_range("seed", arguments.seed, 0, LAST_SEED)
    lanes = whole_number(
        "lanes", len(suite.episodes) if arguments.lanes is None else arguments.lanes
    )
    plan = BenchmarkPlan(
        suite, load(STANDARD).conditions, stimuli, hours, max(1, round(len(suite.episodes) / lanes))
    )
    plan.check_seeds()
    return plan


def _entrants(arguments: Benchmark) -> dict[str, Entrant]:
    """The diagnosers asked for, and all third parties."""
    foreign = load_third_parties(arguments.diagnoser)
    makers = {name: functools.partial(make, name) for name in NAMES} | foreign
    asked = arguments.diagnosers or NAMES
    names = dict.fromkeys([*(known_name("diagnoser", name, makers) for name in asked), *foreign])
    return {name: Entrant(name, makers[name]) for name in names}


def opened(output: Path, arguments: Benchmark, suite: Mapping[str, str]) -> Path:
    """The folder of the trials; an output that holds anything but a benchmark of this suite is refused."""
    output = checked_output(output)
    manifest = read_manifest(output)
    if manifest is not None and {name: manifest.get(name) for name in suite} != suite:
        got = f"{output}, {manifest['command']}, suite {manifest.get('suite')} with hash {manifest.get('hash')}"
        wanted = f"a new folder or a benchmark of suite {suite['suite']} with hash {suite['hash']}"
        raise refusal("output", got, wanted, "choose another --output")
    folder = output / TRIALS
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if manifest is None:
            write_manifest(output, "benchmark", arguments, suite)
    except OSError as error:
        allowed = f"a place that can be written ({error.strerror or error})"
        raise refusal("output", str(output), allowed, "choose another --output") from None
    return folder


def _made(entrants: Mapping[str, Entrant]) -> tuple[dict[str, PreparedEntrant], dict[str, str]]:
    """The diagnosers that can be made and timed, and why others cannot."""
    made: dict[str, PreparedEntrant] = {}
    failures: dict[str, str] = {}
    first = seeds("test", 1, TIMED)[0]
    for name, entrant in tqdm(entrants.items(), desc="timing", unit="diagnoser", file=sys.stderr):
        try:
            diagnoser = entrant.make()
            tensors = diagnoser.tensors() if hasattr(diagnoser, "tensors") else {}
            compute = timing.cost(Contestant(diagnoser), first)
            compute["numbers"] = sum(tensor.size for tensor in tensors.values())
            fingerprint = trial_store.fingerprint(entrant, diagnoser)
            weights = trial_store.weights_digest(diagnoser)
            made[name] = PreparedEntrant(
                entrant, fingerprint, weights, compute, hasattr(diagnoser, "set_truth")
            )
        # whatever ails one diagnoser, the others are scored
        except (Exception, SystemExit) as error:
            note_failure(failures, name, error)
    return made, failures
