"""What stimuli bring, and what they do: ``python -m training.studies.stimuli RESULTS.json ... --output FOLDER``.

From results of `auv-fault benchmark` on one suite with many stimuli, a file for each budget. The results, in which a
triple is a figure and the ends of its 95 % interval::

    command, seed   of this study
    suite           name, hash, every, episodes (how many)
    diagnoser       who is in the loop where behaviour is looked at, and on whom targets are judged
    references      names of the diagnosers that are not ranked
    classes         names of the faults that occur, in the catalogue's order
    lanes           of each class where behaviour is looked at
    budgets         {budget [m/s], as text:
        command, revision   of the benchmark
        stimuli             their names
        figures             {diagnoser: {subset: {stimulus: as `stimulus_comparisons.paired`
        tells}}} costs               {diagnoser: {stimulus: speed_rms [m/s], energy [J per episode],
        false_alarms_per_hour}} behaviour           as `stimulus_behaviour.behaviour` tells ceilings
        {fault: as `active_ceiling.free_ceiling` tells}}
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
from training.benchmark.scores import RANKED_AT
from training.bounds import active_ceiling
from training.report.run_folder import (
    checked_output,
    read_manifest,
    write_json,
    write_manifest,
)
from training.stimuli import STIMULI
from training.studies import stimulus_behaviour
from training.studies.run import command_line, run_study
from training.studies.stimuli_page import page
from training.studies.stimulus_behaviour import behaviour
from training.studies.stimulus_comparisons import LEARNED, REFERENCES, compared, costs, rivals

DIAGNOSER = "filter_bank"  # beside which the agent has learnt
# stimuli whose behaviour is drawn
DRAWN = ("thesis", "triggered_d_optimal", "triggered_surge", "learned")
CEILINGS = "ceilings.json"
SEARCH = (
    "SEVERITY",
    "POPULATION",
    "GENERATIONS",
    "STEP",
    "TRIES",
    "ROUNDS",
    "TRIED_ON",
    "JUDGED_ON",
)
ALL_CORES = -1  # as joblib has it
LAST_SEED = 40_000_000  # within the seeds that are used from there on
NAME = "stimulus-study"


@dataclass(frozen=True)
class StimulusStudy:
    """Compare the stimuli of benchmarks, one for each budget, and look at what they do."""

    results: Annotated[Positional[tuple[Path, ...]], arg(metavar="RESULTS.json")]
    """Results of `auv-fault benchmark` on one suite, cruise and thesis among the stimuli: a file for each budget."""
    output: Path = Path("runs") / NAME
    """Folder of the report; an earlier run there is replaced, and what it knows of ceilings is kept."""
    workers: int | None = None
    """Processes at work; one per core if not given. The results are the same for any number."""
    seed: int = 0
    """Offset within the seeds of validation and of tests, and seed of the bootstrap intervals."""


def main(arguments: StimulusStudy) -> None:
    """Compare, simulate, and write report, figures and results."""
    workers = ALL_CORES if arguments.workers is None else whole_number("workers", arguments.workers)
    finite_in_range("seed", arguments.seed, 0, LAST_SEED)
    benchmarks = read_all(arguments.results)
    output = checked_output(arguments.output)
    if read_manifest(output) is None:
        output.mkdir(parents=True, exist_ok=True)
        write_manifest(output, NAME, arguments)
    found = ceilings(output / CEILINGS, list(benchmarks), workers, arguments.seed)

    def study(_folder: Path) -> dict[str, Any]:
        results = comparison(benchmarks, found, workers, arguments.seed)
        words = ["python", "-m", "training.studies.stimuli", *map(str, arguments.results)]
        return results | {"command": shlex.join([*words, "--seed", str(arguments.seed)])}

    run_study(NAME, arguments, study, page, files_to_keep=[CEILINGS])


def read_all(paths: Sequence[Path]) -> dict[float, dict[str, Any]]:
    """Results of benchmarks by budget [m/s], ascending; those of several suites, or of a budget twice, are refused."""
    found: dict[float, dict[str, Any]] = {}
    for path in paths:
        budget, results = read(path)
        if budget in found:
            raise refusal(
                f"budget of {path}", budget, "one file for each budget", "leave one of them out"
            )
        found[budget] = results
    suites = {
        (one["suite"]["name"], one["suite"]["hash"], one["suite"]["every"])
        for one in found.values()
    }
    if len(suites) != 1:
        raise refusal(
            "suites of the results",
            sorted(suites),
            "the same episodes in all",
            "take results of one suite",
        )
    return dict(sorted(found.items()))


def read(path: Path) -> tuple[float, dict[str, Any]]:
    """Budget [m/s] and results of a benchmark; what is none, or lacks what this study needs, is refused."""
    try:
        results = json.loads(path.read_text(encoding="utf-8"))
        budgets = results["settings"]["stimuli"]
        scores = results["scores"]
        diagnosers = list(results["thresholds"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        shown = f"{path}, {type(error).__name__}: {error}"
        raise refusal(
            "results", shown, "results.json of auv-fault benchmark", "check the path"
        ) from None
    for name in scores:
        known_name(f"stimulus of {path}", name, STIMULI)
    if not {*REFERENCES} <= scores.keys() or len(set(budgets.values())) != 1:
        allowed = f"{' and '.join(REFERENCES)} among them, all with one budget"
        raise refusal(f"stimuli of {path}", budgets, allowed, "run the benchmark with these")
    if DIAGNOSER not in diagnosers:
        raise refusal(
            f"diagnosers of {path}",
            diagnosers,
            f"{DIAGNOSER} among them",
            "run the benchmark with it",
        )
    return next(iter(budgets.values())), results


def comparison(
    benchmarks: Mapping[float, Mapping[str, Any]], found: Mapping[str, Any], workers: int, seed: int
) -> dict[str, Any]:
    """All results, from those of benchmarks by budget, and the ceilings found."""
    first = next(iter(benchmarks.values()))
    faults = first["episodes"]["fault"]
    return {
        "seed": seed,
        "suite": {key: first["suite"][key] for key in ("name", "hash", "every")}
        | {"episodes": len(faults)},
        "diagnoser": DIAGNOSER,
        "references": first["references"],
        "classes": [first["classes"][k] for k in sorted(set(faults))],
        "lanes": stimulus_behaviour.PER_CLASS,
        "budgets": {
            f"{budget:g}": _study(one, budget, workers, seed) | {"ceilings": found[f"{budget:g}"]}
            for budget, one in benchmarks.items()
        },
    }


def _study(benchmark: Mapping[str, Any], budget: float, workers: int, seed: int) -> dict[str, Any]:
    scores = benchmark["scores"]
    level = benchmark["thresholds"][DIAGNOSER][RANKED_AT]
    fault = [benchmark["classes"][k] for k in benchmark["episodes"]["fault"]]
    drawn = [name for name in DRAWN if name in scores]
    counted = [
        name for name in scores if name in {*drawn, *rivals(scores)} or LEARNED.fullmatch(name)
    ]
    threshold = -math.inf if level is None else level
    return {
        "command": benchmark["command"],
        "revision": benchmark["revision"],
        "stimuli": list(scores),
        "figures": {name: compared(scores, name, fault, seed) for name in benchmark["thresholds"]},
        "costs": {name: costs(scores, name) for name in benchmark["thresholds"]},
        "behaviour": behaviour(drawn, counted, budget, DIAGNOSER, threshold, workers, seed),
    }


def ceilings(
    path: Path, budgets: Sequence[float], workers: int, seed: int
) -> dict[str, dict[str, Any]]:
    """By budget and fault what `active_ceiling.free_ceiling` finds.

    Each is written to the file when it is found, and what the file has that was sought in the same
    way is taken from there: they take the longest.
    """
    settings = {"seed": seed} | {name: getattr(active_ceiling, name) for name in SEARCH}
    found = _known(path, settings)
    missing = [
        (f"{budget:g}", fault, seed, budget)
        for budget in budgets
        for fault in active_ceiling.FAULTS
        if fault not in found.get(f"{budget:g}", {})
    ]
    jobs = (delayed(active_ceiling.free_ceiling)(*one[1:]) for one in missing)
    made = tqdm(
        Parallel(n_jobs=workers, return_as="generator")(jobs), total=len(missing), desc="ceilings"
    )
    for (budget, fault, *_), one in zip(missing, made, strict=True):
        found.setdefault(budget, {})[fault] = one
        write_json(path, {"settings": settings, "budgets": found})
    return found


def _known(path: Path, settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return content["budgets"] if content["settings"] == settings else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


if __name__ == "__main__":
    command_line(main)
