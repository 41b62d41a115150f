"""The results of a benchmark as plain data: what results.json and results.csv hold."""

import csv
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env.faults import CATALOGUE, classes
from diagnosers import NAMES, ranked
from training.benchmark import trial_store
from training.benchmark.bounds import bounds_of
from training.benchmark.failures import note_failure, one_line
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.preparation import PreparedEntrant
from training.benchmark.scores import (
    METRICS,
    RATE_METRICS,
    ScoreInputs,
    TrialOutcomes,
    assess_at_rates,
    csv_cells,
    score,
    thresholds,
)
from training.benchmark.trials import (
    COUNTING,
    FAULTY,
    PARTS,
    THRESHOLD,
    LaneTruth,
    Trial,
    lane_truth,
)
from training.benchmark.workers import with_catalogue
from training.benchmark.worst_episodes import worst_episodes
from training.metrics.plain import finite, rounded
from training.metrics.records import DECISION_TIMES, HORIZON, PERSISTENCE, SEVERITY_AT
from training.report.run_folder import provenance
from training.stimuli import Cruise, Stimulus

# lanes that the bounds are computed on, 60 of each class: from few lanes they come out too high
N_BOUND_LANES = 1080
# What results.json holds, by key. Classes are indices into `classes`, 0 is normal.
RESULTS: dict[str, str] = {
    "command": "the command line",
    "suite": "name, about, hash, plant, duration [s], listed (episodes in the file), every (each "
    "so many-th was run)",
    "seeds": "first and last of faulty, threshold and counting lanes; seed of the bootstrap",
    "settings": "persistence [samples], horizon [s], decided_at [s], severity_at [s], hours and "
    "counting_hours (of each diagnoser, all stimuli together), stimuli with their budgets [m/s]",
    "classes": "names of the classes",
    "references": "diagnosers that are not ranked",
    "third_parties": "where diagnosers from outside the package come from",
    "failures": "by diagnoser the reason why it is left out",
    "weights": "by diagnoser the digest of its weights, null if it has none",
    "compute": "by diagnoser p50_us, p99_us and many_lanes_us of an update, and numbers of weights",
    "versions": "of the packages",
    "revision": "of the source",
    "thresholds": "by diagnoser and rate the threshold of log p(normal), null for minus infinity",
    "episodes": "faulty episodes that were run: seed, fault, onset [s], severity (full), ramp [s], "
    "abrupt",
    "decided": "by stimulus the true classes that go with `decision` in `by_lane`: all faulty "
    "lanes, then some healthy ones",
    "scores": "by stimulus and diagnoser the metrics below",
    "bounds": "by stimulus the bounds of `training.benchmark.bounds`; of the suite ideal only",
}


def header(
    command: str,
    plan: BenchmarkPlan,
    seed: int,
    prepared: Mapping[str, PreparedEntrant],
    failures: Mapping[str, str],
) -> dict[str, Any]:
    """All but what comes from the trials; `seed` is that of the bootstrap."""
    suite = plan.suite
    foreign = {name: entry for name, entry in prepared.items() if name not in NAMES}
    competing = set(ranked())
    references = [
        name
        for name, entry in prepared.items()
        if entry.knows_truth or (name in NAMES and name not in competing)
    ]
    return {
        "command": command,
        "suite": {
            "name": suite.name,
            "about": suite.about,
            "hash": suite.hash,
            "plant": dict(suite.conditions.plant),
            "duration": suite.conditions.duration,
            "listed": len(suite.episodes),
            "every": plan.every,
        },
        "seeds": {part: _first_and_last_seed(plan, part) for part in PARTS} | {"bootstrap": seed},
        "settings": {
            "persistence": PERSISTENCE,
            "horizon": HORIZON,
            "decided_at": list(DECISION_TIMES),
            "severity_at": SEVERITY_AT,
            "hours": plan.hours[THRESHOLD],
            "counting_hours": plan.hours[COUNTING],
            "stimuli": {stimulus.name: stimulus.budget for stimulus in plan.stimuli},
        },
        "classes": list(classes()),
        "references": references,
        "third_parties": {name: entry.entrant.make.target for name, entry in foreign.items()},
        "failures": dict(failures),
        "weights": {name: entry.weights for name, entry in prepared.items()},
        "compute": {name: entry.compute for name, entry in prepared.items()},
        **provenance(),
    }


def _first_and_last_seed(plan: BenchmarkPlan, part: str) -> list[int]:
    seeds = []
    for stimulus in plan.stimuli:
        seeds += [episode.seed for episode in plan.episodes(part, stimulus)]
    return [min(seeds), max(seeds)]


def scored(
    plan: BenchmarkPlan,
    paths: Mapping[Path, Trial],
    seed: int,
    failures: dict[str, str],
) -> dict[str, Any]:
    """Thresholds, truth, every score; a diagnoser that fails in its worst episodes is left out."""
    files = _files(paths)
    names = dict.fromkeys(name for name, _, _ in files)
    truth = lane_truth(plan.suite.conditions, plan.faulty_episodes)
    results: dict[str, Any] = {
        "thresholds": {},
        "episodes": episode_table(plan, truth),
        "decided": {},
        "scores": {stimulus.name: {} for stimulus in plan.stimuli},
    }
    for name in tqdm(names, desc="scores", unit="diagnoser"):
        outcomes = _outcomes(files, name, list(results["scores"]))
        inputs = {}
        for stimulus, of_stimulus in outcomes.items():
            assessments = assess_at_rates(of_stimulus, truth)
            inputs[stimulus] = ScoreInputs(assessments, truth, of_stimulus, [], seed)
        try:
            for stimulus, before in inputs.items():
                first_trial = paths[files[name, stimulus, FAULTY][0]]
                trial = first_trial._replace(episodes=plan.faulty_episodes)
                faulty = before.outcomes.faulty
                worst = worst_episodes(trial, faulty, before.ranked, truth)
                inputs[stimulus] = before._replace(worst=worst)
        # whatever fails in one diagnoser, the others are scored
        except (Exception, SystemExit) as error:
            note_failure(failures, name, one_line(error))
            continue
        levels = thresholds(next(iter(outcomes.values())).threshold)
        results["thresholds"][name] = {rate: finite(level) for rate, level in levels.items()}
        for stimulus, of_stimulus in inputs.items():
            results["decided"][stimulus] = of_stimulus.ranked.label.tolist()
            results["scores"][stimulus][name] = score(of_stimulus)
    return results


def _files(paths: Mapping[Path, Trial]) -> dict[tuple[str, str, str], list[Path]]:
    """The files of each diagnoser, stimulus and part, in the order of their lanes."""
    files: dict[tuple[str, str, str], list[Path]] = {}
    for path, trial in paths.items():
        key = trial.entrant.name, trial.stimulus.name, trial.part
        files.setdefault(key, []).append(path)
    return files


def _outcomes(
    files: Mapping[tuple[str, str, str], list[Path]],
    name: str,
    stimuli: Sequence[str],
) -> dict[str, TrialOutcomes]:
    """By stimulus what a diagnoser is scored on."""
    setting_files = [files[name, stimulus, THRESHOLD] for stimulus in stimuli]
    setting = trial_store.read(list(chain(*setting_files)), THRESHOLD)
    faulty_files = {stimulus: files[name, stimulus, FAULTY] for stimulus in stimuli}
    faulty = {stimulus: trial_store.read(of, FAULTY) for stimulus, of in faulty_files.items()}
    under_cruise = faulty.get(Cruise.name)
    outcomes = {}
    for stimulus in stimuli:
        counting = trial_store.read(files[name, stimulus, COUNTING], COUNTING)
        outcomes[stimulus] = TrialOutcomes(setting, counting, faulty[stimulus], under_cruise)
    return outcomes


def episode_table(plan: BenchmarkPlan, truth: LaneTruth) -> dict[str, list[Any]]:
    """The faulty episodes that were run; the ramp is that of the worst fault."""
    episodes = plan.faulty_episodes
    worst = [max(episode.schedule, key=lambda event: event.severity) for episode in episodes]
    ramps = [event.ramp for event in worst]
    return {
        "seed": [episode.seed for episode in episodes],
        "fault": truth.at_instants.fault.tolist(),
        "onset": rounded(truth.at_instants.onset),
        "severity": rounded(truth.full_severity),
        "ramp": ramps,
        "abrupt": [ramp == 0.0 for ramp in ramps],
    }


def bounds_by_stimulus(
    stimuli: Sequence[Stimulus], seed: int, workers: int, backend: str
) -> dict[str, Any]:
    """By stimulus the delays that no diagnoser can beat under the standard conditions."""
    faults = dict(CATALOGUE)
    jobs = (
        delayed(with_catalogue)(faults, bounds_of, stimulus, seed, N_BOUND_LANES)
        for stimulus in stimuli
    )
    bounds = Parallel(n_jobs=workers, backend=backend)(jobs)
    return {stimulus.name: bound for stimulus, bound in zip(stimuli, bounds, strict=True)}


def write_csv(path: Path, results: Mapping[str, Any]) -> None:
    """A row for each stimulus, diagnoser and mean time between false alarms."""
    suite = results["suite"]["name"]
    rows = []
    for stimulus, scores in results["scores"].items():
        for name, of_score in scores.items():
            for rate, at_rate in of_score["rates"].items():
                row = {
                    "suite": suite,
                    "stimulus": stimulus,
                    "diagnoser": name,
                    "mtbfa": rate,
                }
                row |= csv_cells(RATE_METRICS, at_rate)
                row |= csv_cells(METRICS, of_score)
                rows.append(row)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
