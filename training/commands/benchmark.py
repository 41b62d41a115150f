"""``auv-fault benchmark``: diagnosers and stimuli on a suite, at set rates of false alarms."""

import functools
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from auv_fault_env.errors import known_name, refusal
from diagnosers import NAMES, make
from training.arguments import Benchmark
from training.benchmark import trial_store
from training.benchmark.page import page
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.preparation import prepare
from training.benchmark.results import bounds_by_stimulus, header, scored, write_csv
from training.benchmark.suites import IDEAL, STANDARD, load
from training.benchmark.third_parties import load_third_parties
from training.benchmark.trials import COUNTING, THRESHOLD, Entrant
from training.benchmark.workers import check_backend, run_missing
from training.report.page import print_tables, write_report
from training.report.run_folder import (
    SUBCOMMAND,
    checked_output,
    read_manifest,
    run_folder,
    write_json,
)
from training.stimuli import STIMULI
from training.stimuli.closed_loop import ClosedLoop

TRIALS = "trials"
ALL_CORES = -1  # as joblib has it


class Run(NamedTuple):
    """A benchmark to run.

    Attributes
    ----------
    name, arguments, command
        Subcommand and arguments for the manifest; the command line for the results.
    suite_identity
        Entries of the manifest by which a run is known whose trials can be taken over.
    seed
        Of the bootstrap.
    failures
        Why diagnosers are left out that are no entrants, by name.
    workers, backend
        As joblib has them.
    """

    name: str
    arguments: Any
    command: str
    output: Path
    suite_identity: Mapping[str, str]
    plan: BenchmarkPlan
    entrants: Mapping[str, Entrant]
    failures: Mapping[str, str]
    seed: int
    workers: int
    backend: str


def main(arguments: Benchmark) -> None:
    """Run what has not been run yet, score it, and write report, figures and results."""
    plan = _plan(arguments)
    third_parties, failures = load_third_parties(arguments.diagnoser, arguments.time_limit)
    entrants = named_entrants(arguments.diagnosers or NAMES, third_parties)
    workers = ALL_CORES if arguments.workers is None else arguments.workers
    check_backend(arguments.backend)
    run = Run(
        name="benchmark",
        arguments=arguments,
        command=command(arguments),
        output=arguments.output or Path("runs") / f"benchmark-{plan.suite.name}",
        suite_identity={"suite": plan.suite.name, "hash": plan.suite.hash},
        plan=plan,
        entrants=entrants,
        failures=failures,
        seed=arguments.seed,
        workers=workers,
        backend=arguments.backend,
    )
    run_benchmark(run)


def run_benchmark(run: Run) -> None:
    """Run what has not been run yet, score it, and write report, figures and results."""
    folder = trials_folder(run)
    try:
        with trial_store.held_folder(folder):
            results = _results(run, folder)
        report = page(results)
        notes = run.suite_identity
        with run_folder(run.output, run.name, run.arguments, notes, [TRIALS]) as new_folder:
            write_json(new_folder / "results.json", results)
            write_csv(new_folder / "results.csv", results)
            write_report(report, new_folder)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            "the trials that are done are kept, and the same command goes on from there"
        ) from None
    # what was run, and the leaderboards
    print_tables(report["sections"][: 1 + len(run.plan.stimuli)])
    print(f"\nreport: {run.output / 'index.html'}")


def _results(run: Run, folder: Path) -> dict[str, Any]:
    """All results, from trials that are run if they are not in the folder."""
    plan = run.plan
    prepared, failures = prepare(run.entrants)
    failures = {**run.failures, **failures}
    paths = {}
    for trial in plan.trials([entry.entrant for entry in prepared.values()]):
        fingerprint = prepared[trial.entrant.name].fingerprint
        paths[trial_store.path_of(folder, trial, fingerprint)] = trial
    failures |= run_missing(paths, run.workers, run.backend)
    paths = {path: trial for path, trial in paths.items() if trial.entrant.name not in failures}
    scores = scored(plan, paths, run.seed, failures)
    working = {name: entry for name, entry in prepared.items() if name not in failures}
    if not working:
        allowed = "at least one that works"
        raise refusal("diagnosers", list(run.entrants), allowed, "see above why they fail")
    results = header(run.command, plan, run.seed, working, failures) | scores
    # bounds are those of the suite's faults, for any diagnoser
    if plan.suite == load(IDEAL) and plan.every == 1:
        open_loop = [s for s in plan.stimuli if not isinstance(s, ClosedLoop)]
        results["bounds"] = bounds_by_stimulus(open_loop, run.seed, run.workers, run.backend)
    return results


def _plan(arguments: Benchmark) -> BenchmarkPlan:
    suite = load(arguments.suite)
    names = dict.fromkeys(known_name("stimulus", name, STIMULI) for name in arguments.stimuli)
    stimuli = [STIMULI[name](arguments.budget) for name in names]
    if not stimuli:
        raise refusal("stimuli", arguments.stimuli, f"some of {', '.join(STIMULI)}", "name one")
    hours = {THRESHOLD: arguments.hours, COUNTING: arguments.counting_hours}
    n_listed = len(suite.episodes)
    every = max(1, round(n_listed / (arguments.lanes or n_listed)))
    plan = BenchmarkPlan(suite, load(STANDARD).conditions, stimuli, hours, every)
    plan.check_seeds()
    return plan


def named_entrants(names: Iterable[str], third_parties: Mapping[str, Any]) -> dict[str, Entrant]:
    """Entrants of these names, and all third parties; an unknown name is refused."""
    makers = {name: functools.partial(make, name) for name in NAMES} | third_parties
    known = [known_name("diagnoser", name, makers) for name in names]
    return {name: Entrant(name, makers[name]) for name in dict.fromkeys([*known, *third_parties])}


def trials_folder(run: Run) -> Path:
    """The folder of the trials; an output with anything but a run of this suite is refused."""
    output = checked_output(run.output, SUBCOMMAND + run.name, [TRIALS])
    manifest = read_manifest(output)
    identity = run.suite_identity
    if manifest is not None and {key: manifest.get(key) for key in identity} != identity:
        earlier = ", ".join(f"{key} {manifest.get(key)}" for key in identity)
        wanted = ", ".join(f"{key} {value}" for key, value in identity.items())
        thing = f"{output}, {manifest['command']}, {earlier}"
        allowed = f"a new folder or a run with {wanted}"
        raise refusal("output", thing, allowed, "choose another --output")
    if manifest is None:
        with run_folder(output, run.name, run.arguments, identity):
            pass
    folder = output / TRIALS
    folder.mkdir(exist_ok=True)
    return folder


def command(arguments: Benchmark) -> str:
    """The command line that gives these results, without what they do not depend on."""
    words = ["auv-fault", "benchmark"]
    for name in ("suite", "stimuli", "budget", "hours", "counting_hours", "seed"):
        words += [f"--{name.replace('_', '-')}", *_words(getattr(arguments, name))]
    if arguments.diagnosers:
        words += ["--diagnosers", *arguments.diagnosers]
    for target in arguments.diagnoser:
        words += ["--diagnoser", target]
    if arguments.lanes:
        words += ["--lanes", str(arguments.lanes)]
    return shlex.join(words)


def _words(value: Any) -> Sequence[str]:
    if isinstance(value, tuple):
        return value
    return [f"{value:.12g}" if isinstance(value, float) else str(value)]
