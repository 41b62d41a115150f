"""What stimuli achieve: ``python -m training.studies.stimuli RESULTS.json ... --output FOLDER``.

It compares results of `auv-fault benchmark` on one suite with many stimuli, one file for each
budget. In its own results a triple is a figure and the ends of its 95 % interval::

    command, seed   of this study
    suite           name, hash, every, episodes (their number)
    diagnoser       the one in the closed loop, with which targets are judged
    references      names of the diagnosers that do not compete
    classes         names of the faults that occur, in the order of the catalogue
    lanes           vehicles of each class in the closed loop
    budgets         {budget [m/s] as text: the following}
      command, revision   of the benchmark
      stimuli             their names
      figures             {diagnoser: `stimulus_comparisons.compare_by_subset`}
      costs               {diagnoser: `stimulus_comparisons.mean_costs`}
      behaviour           `stimulus_behaviour.behaviour`
      ceilings            {fault: `active_ceiling.free_ceiling`}
"""

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from joblib import Parallel, delayed
from tqdm import tqdm
from tyro.conf import Positional, arg

from auv_fault_env.errors import finite_in_range, known_name, refusal, whole_number
from auv_fault_env.faults import CATALOGUE
from training.benchmark.scores import RANKED_AT
from training.benchmark.workers import with_catalogue
from training.bounds import active_ceiling
from training.report.run_folder import (
    STUDY,
    checked_output,
    read_manifest,
    run_folder,
    write_json,
)
from training.stimuli import STIMULI
from training.studies import stimulus_behaviour
from training.studies.run import command_line, run_study
from training.studies.stimuli_page import page
from training.studies.stimulus_behaviour import behaviour
from training.studies.stimulus_comparisons import (
    LEARNED,
    REFERENCES,
    compare_by_subset,
    mean_costs,
    rules_from_belief,
)

# the one for which the agent was trained, on beliefs of `training.stimuli.light_bank`
DIAGNOSER = "filter_bank"
# stimuli that run on faulty vehicles in the closed loop
ON_FAULTY = ("thesis", "triggered_d_optimal", "triggered_surge", "learned")
CEILINGS_FILE = "ceilings.json"
# settings of the search for ceilings, in `training.bounds.active_ceiling`
SEARCH_SETTINGS = (
    *("SEVERITY", "POPULATION", "GENERATIONS", "STEP"),
    *("TRIES", "ROUNDS", "TRIED_ON", "JUDGED_ON"),
)
# in the convention of joblib
ALL_CORES = -1
# within the range of seeds that the study has
LARGEST_SEED = 40_000_000


@dataclass(frozen=True)
class StimulusStudy:
    """Compare the stimuli of benchmarks, one for each budget, and record what they do."""

    results: Annotated[Positional[tuple[Path, ...]], arg(metavar="RESULTS.json")]
    """Results of `auv-fault benchmark` on one suite with cruise and thesis, a file per budget."""
    output: Path = Path("runs/stimulus-study")
    """Folder of the report; an earlier run there is replaced, except for its ceilings."""
    workers: int | None = None
    """Number of processes, one per core if not given; the results do not depend on it."""
    seed: int = 0
    """Offset within the seeds of validation and of tests, and seed of the bootstrap intervals."""


def main(arguments: StimulusStudy) -> None:
    """Compare and simulate stimuli, and write results and page."""
    workers = ALL_CORES if arguments.workers is None else whole_number("workers", arguments.workers)
    finite_in_range("seed", arguments.seed, 0, LARGEST_SEED)
    benchmarks = load_benchmarks(arguments.results)
    output = checked_output(arguments.output, STUDY + "stimuli", [CEILINGS_FILE])
    if read_manifest(output) is None:
        # the ceilings are saved there before the run is complete
        with run_folder(output, "stimuli", arguments, program=STUDY):
            pass
    ceilings = find_ceilings(output / CEILINGS_FILE, list(benchmarks), workers, arguments.seed)

    def study(_folder: Path) -> dict[str, Any]:
        results = summary(benchmarks, ceilings, workers, arguments.seed)
        words = shlex.join([*map(str, arguments.results), "--seed", str(arguments.seed)])
        return results | {"command": f"{STUDY}stimuli {words}"}

    run_study("stimuli", arguments, study, page, files_to_keep=[CEILINGS_FILE])


def load_benchmarks(paths: Sequence[Path]) -> dict[float, dict[str, Any]]:
    """Results of benchmarks by ascending budget [m/s].

    Raises
    ------
    InputError
        Where a file is not such a result, or suites differ, or a budget occurs twice.
    """
    benchmarks: dict[float, dict[str, Any]] = {}
    for path in paths:
        budget, results = load_benchmark(path)
        if budget in benchmarks:
            allowed = "one file for each budget"
            raise refusal(f"budget of {path}", budget, allowed, "leave one of them out")
        benchmarks[budget] = results
    suites = [results["suite"] for results in benchmarks.values()]
    keys = {(suite["name"], suite["hash"], suite["every"]) for suite in suites}
    if len(keys) != 1:
        allowed = "the same episodes in all"
        raise refusal(
            "suites of the results",
            sorted(keys),
            allowed,
            "take results of one suite",
        )
    return dict(sorted(benchmarks.items()))


def load_benchmark(path: Path) -> tuple[float, dict[str, Any]]:
    """Budget [m/s] and results of a benchmark with all that this study needs; else `InputError`."""
    try:
        results = json.loads(path.read_text(encoding="utf-8"))
        budgets = results["settings"]["stimuli"]
        scores = results["scores"]
        diagnosers = list(results["thresholds"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        value = f"{path}, {type(error).__name__}: {error}"
        allowed = "results.json of auv-fault benchmark"
        raise refusal("results", value, allowed, "check the path") from None
    for name in scores:
        known_name(f"stimulus of {path}", name, STIMULI)
    if not {*REFERENCES} <= scores.keys() or len(set(budgets.values())) != 1:
        allowed = f"{' and '.join(REFERENCES)} among them, all with one budget"
        raise refusal(f"stimuli of {path}", budgets, allowed, "run the benchmark with these")
    if DIAGNOSER not in diagnosers:
        allowed = f"{DIAGNOSER} among them"
        raise refusal(f"diagnosers of {path}", diagnosers, allowed, "run the benchmark with it")
    return next(iter(budgets.values())), results


def summary(
    benchmarks: Mapping[float, Mapping[str, Any]],
    ceilings: Mapping[str, Any],
    workers: int,
    seed: int,
) -> dict[str, Any]:
    """All results but the command, from benchmarks by budget and the ceilings by budget."""
    first = next(iter(benchmarks.values()))
    suite = {key: first["suite"][key] for key in ("name", "hash", "every")}
    faults = first["episodes"]["fault"]
    budgets = {}
    for budget, benchmark in benchmarks.items():
        text = f"{budget:g}"
        budgets[text] = _of_budget(benchmark, budget, workers, seed) | {"ceilings": ceilings[text]}
    return {
        "seed": seed,
        "suite": suite | {"episodes": len(faults)},
        "diagnoser": DIAGNOSER,
        "references": first["references"],
        "classes": [first["classes"][k] for k in sorted(set(faults))],
        "lanes": stimulus_behaviour.PER_CLASS,
        "budgets": budgets,
    }


def _of_budget(
    benchmark: Mapping[str, Any], budget: float, workers: int, seed: int
) -> dict[str, Any]:
    scores = benchmark["scores"]
    diagnosers = benchmark["thresholds"]
    fault = [benchmark["classes"][k] for k in benchmark["episodes"]["fault"]]
    level = diagnosers[DIAGNOSER][RANKED_AT]
    threshold = -math.inf if level is None else level
    on_faulty = [name for name in ON_FAULTY if name in scores]
    selected = {*on_faulty, *rules_from_belief(scores)}
    on_healthy = [name for name in scores if name in selected or LEARNED.fullmatch(name)]
    return {
        "command": benchmark["command"],
        "revision": benchmark["revision"],
        "stimuli": list(scores),
        "figures": {name: compare_by_subset(scores, name, fault, seed) for name in diagnosers},
        "costs": {name: mean_costs(scores, name) for name in diagnosers},
        "behaviour": behaviour(on_faulty, on_healthy, budget, DIAGNOSER, threshold, workers, seed),
    }


def find_ceilings(
    path: Path, budgets: Sequence[float], workers: int, seed: int
) -> dict[str, dict[str, Any]]:
    """By budget, as text, and fault the result of `active_ceiling.free_ceiling`.

    The search takes longest in this study. Therefore each ceiling is written to the file at `path`
    when it is found, and ceilings in the file with the same settings are not searched again.
    """
    settings = {"seed": seed}
    settings |= {name: getattr(active_ceiling, name) for name in SEARCH_SETTINGS}
    ceilings = _saved_ceilings(path, settings)
    missing = [
        (budget, fault)
        for budget in budgets
        for fault in active_ceiling.FAULTS
        if fault not in ceilings.get(f"{budget:g}", {})
    ]
    call = delayed(with_catalogue)
    faults = dict(CATALOGUE)
    search = active_ceiling.free_ceiling
    calls = (call(faults, search, fault, seed, budget) for budget, fault in missing)
    searches = Parallel(n_jobs=workers, return_as="generator")(calls)
    progress = tqdm(searches, total=len(missing), desc="ceilings")
    for (budget, fault), ceiling in zip(missing, progress, strict=True):
        ceilings.setdefault(f"{budget:g}", {})[fault] = ceiling
        write_json(path, {"settings": settings, "budgets": ceilings})
    return ceilings


def _saved_ceilings(path: Path, settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return content["budgets"] if content["settings"] == settings else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


if __name__ == "__main__":
    command_line(main)
