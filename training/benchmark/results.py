"""The results of a benchmark, put together from its trials; their form is told in `training.benchmark.scores`."""

import csv
import shlex
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env.faults import CATALOGUE, classes
from diagnosers import NAMES, ranked
from training.arguments import Benchmark
from training.benchmark import trial_store
from training.benchmark.bounds import bounds_of
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.scores import (
    RANKED_AT,
    TrialOutcomes,
    assess_at_rates,
    rounded,
    score,
    thresholds,
)
from training.benchmark.scoring import finite
from training.benchmark.trials import (
    COUNTING,
    FAULTY,
    THRESHOLD,
    Entrant,
    LaneTruth,
    Trial,
    lane_truth,
)
from training.benchmark.validation import SEVERITY_AT, note_failure
from training.benchmark.workers import with_catalogue
from training.benchmark.worst_episodes import worst_episodes
from training.metrics.records import DECISION_TIMES, HORIZON, PERSISTENCE
from training.report.run_folder import provenance
from training.stimuli import Cruise, Stimulus

# lanes that the bounds are computed on, 60 of each class: from few lanes they come out too high
BOUNDED = 1080
ROW = ("restricted_mean", "probability", "median")


class PreparedEntrant(NamedTuple):
    """A diagnoser that could be made: how to make more, what its beliefs depend on, what it has learnt, its cost.

    told: whether it is told the truth about the vehicles, and so does not compete.
    """

    entrant: Entrant
    fingerprint: str
    weights: str | None
    compute: dict[str, float]
    episode_table: bool


def header(
    arguments: Benchmark,
    plan: BenchmarkPlan,
    made: Mapping[str, PreparedEntrant],
    failures: Mapping[str, str],
) -> dict[str, Any]:
    """All but what comes from the trials."""
    suite = plan.suite
    names = set(ranked())
    return {
        "command": command(arguments),
        "suite": {
            "name": suite.name,
            "about": suite.about,
            "hash": suite.hash,
            "plant": dict(suite.conditions.plant),
            "duration": suite.conditions.duration,
            "listed": len(suite.episodes),
            "every": plan.every,
        },
        "seeds": {part: _ends(plan, part) for part in (FAULTY, THRESHOLD, COUNTING)}
        | {"bootstrap": arguments.seed},
        "settings": {
            "persistence": PERSISTENCE,
            "horizon": HORIZON,
            "decided_at": list(DECISION_TIMES),
            "severity_at": SEVERITY_AT,
            "hours": arguments.hours,
            "counting_hours": arguments.counting_hours,
            "stimuli": {stimulus.name: stimulus.budget for stimulus in plan.stimuli},
        },
        "classes": list(classes()),
        "references": [
            name for name, one in made.items() if one.told or (name in NAMES and name not in names)
        ],
        "third_parties": {
            name: one.entrant.make.target for name, one in made.items() if name not in NAMES
        },
        "failures": dict(failures),
        "weights": {name: one.weights for name, one in made.items()},
        "compute": {name: one.compute for name, one in made.items()},
        **provenance(),
    }


def command(arguments: Benchmark) -> str:
    """The command line that gives these results, without what they do not depend on."""
    names = ("suite", "stimuli", "budget", "hours", "counting_hours", "seed")
    given = {name: getattr(arguments, name) for name in names}
    words = [
        word
        for name, value in given.items()
        for word in (f"--{name.replace('_', '-')}", *_words(value))
    ]
    words += ["--diagnosers", *arguments.diagnosers] if arguments.diagnosers else []
    words += [word for target in arguments.diagnoser for word in ("--diagnoser", target)]
    words += ["--lanes", str(arguments.lanes)] if arguments.lanes else []
    return shlex.join(["auv-fault", "benchmark", *words])


def _words(value: Any) -> Sequence[str]:
    return (
        value
        if isinstance(value, tuple)
        else [f"{value:.12g}" if isinstance(value, float) else str(value)]
    )


def _ends(plan: BenchmarkPlan, part: str) -> list[int]:
    """The least and the greatest seed of a part."""
    found = [episode.seed for stimulus in plan.stimuli for episode in plan.episodes(part, stimulus)]
    return [min(found), max(found)]


def scored(
    plan: BenchmarkPlan, paths: Mapping[Path, Trial], seed: int, failures: dict[str, str]
) -> dict[str, Any]:
    """Thresholds, the truth and every score; who fails on the worst episodes, run once more, joins the failures."""
    files = _files(paths)
    names = list(dict.fromkeys(name for name, _, _ in files))
    stimuli = [stimulus.name for stimulus in plan.stimuli]
    episodes = plan.suite.episodes[:: plan.every]
    truth = lane_truth(plan.suite.conditions, episodes)
    results: dict[str, Any] = {
        "thresholds": {},
        "episodes": episode_table(episodes, truth),
        "decided": {},
        "scores": {},
    }
    results["scores"] = {stimulus: {} for stimulus in stimuli}
    for name in tqdm(names, desc="scores", unit="diagnoser"):
        materials = _materials(files, name, stimuli)
        judged = {
            stimulus: assess_at_rates(material, truth) for stimulus, material in materials.items()
        }
        trials = {
            stimulus: paths[files[name, stimulus, FAULTY][0]]._replace(episodes=episodes)
            for stimulus in stimuli
        }
        try:
            worst = {
                stimulus: worst_episodes(
                    trials[stimulus], materials[stimulus].faulty, one[RANKED_AT], truth
                )
                for stimulus, one in judged.items()
            }
        # whatever ails one diagnoser, the others are scored
        except (Exception, SystemExit) as error:
            note_failure(failures, name, error)
            continue
        results["thresholds"][name] = {
            rate: finite(level) for rate, level in thresholds(materials[stimuli[0]].setting).items()
        }
        for stimulus, one in judged.items():
            results["decided"][stimulus] = one[RANKED_AT].label.tolist()
            of_stimulus = score(materials[stimulus], one, truth, seed)
            results["scores"][stimulus][name] = of_stimulus | {"worst": worst[stimulus]}
    return results


def _materials(
    files: Mapping[tuple[str, str, str], list[Path]], name: str, stimuli: Sequence[str]
) -> dict[str, TrialOutcomes]:
    """By stimulus what a diagnoser is scored on."""
    setting = trial_store.read(
        list(chain(*(files[name, stimulus, THRESHOLD] for stimulus in stimuli))), THRESHOLD
    )
    faulty = {
        stimulus: trial_store.read(files[name, stimulus, FAULTY], FAULTY) for stimulus in stimuli
    }
    counting = {
        stimulus: trial_store.read(files[name, stimulus, COUNTING], COUNTING)
        for stimulus in stimuli
    }
    passive = faulty.get(Cruise.name)
    return {one: TrialOutcomes(setting, counting[one], faulty[one], passive) for one in stimuli}


def bounds(stimuli: Sequence[Stimulus], seed: int, workers: int, backend: str) -> dict[str, Any]:
    """By stimulus the delays that no diagnoser can beat under the standard conditions."""
    found = Parallel(n_jobs=workers, backend=backend)(
        delayed(with_catalogue)(dict(CATALOGUE), bounds_of, one, seed, BOUNDED) for one in stimuli
    )
    return {stimulus.name: bound for stimulus, bound in zip(stimuli, found, strict=True)}


def _files(paths: Mapping[Path, Trial]) -> dict[tuple[str, str, str], list[Path]]:
    """The files of each diagnoser, stimulus and part, in the order of their lanes."""
    files: dict[tuple[str, str, str], list[Path]] = {}
    for path, trial in paths.items():
        files.setdefault((trial.entrant.name, trial.stimulus.name, trial.part), []).append(path)
    return files


def episode_table(episodes: Sequence[Any], truth: LaneTruth) -> dict[str, list[Any]]:
    """The faulty episodes that were run."""
    ramps = [max(episode.schedule, key=lambda event: event.severity).ramp for episode in episodes]
    return {
        "seed": [episode.seed for episode in episodes],
        "fault": truth.at_instants.fault.tolist(),
        "onset": rounded(truth.at_instants.onset),
        "severity": rounded(truth.full_severity),
        "ramp": ramps,
        "abrupt": [ramp == 0.0 for ramp in ramps],
    }


def write_csv(path: Path, results: Mapping[str, Any]) -> None:
    """A row for each stimulus, diagnoser and mean time between false alarms."""
    rows = [
        {"suite": results["suite"]["name"], "stimulus": stimulus, "diagnoser": name, "mtbfa": rate}
        | {
            key: score["rates"][rate][key]
            for key in ("threshold", "false_alarms", "hours", "false_alarms_per_hour")
        }
        | {
            f"{what}_{key}": score["rates"][rate][what][key]
            for what in ("isolation", "detection")
            for key in ROW
        }
        | {
            key: score[key]
            for key in ("macro_f1", "severity_mae", "severity_coverage", "ece", "brier", "log_loss")
        }
        | score["cost"]
        for stimulus, by_name in results["scores"].items()
        for name, score in by_name.items()
        for rate in score["rates"]
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
