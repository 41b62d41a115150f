"""What the ablation computes: features, networks and what these do, each kept in a file.

A run that was stopped takes from the files what it has finished. Their names hold a digest of the
code and of the settings.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env.compiling import digest
from diagnosers import make
from training.benchmark import suites
from training.benchmark.assessment import DECISION_TIME, Assessment
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.scores import calibration_error
from training.benchmark.trials import COUNTING, FAULTY, THRESHOLD, Entrant
from training.benchmark.validation_suite import validation_suite
from training.learning.reproducible import one_thread
from training.metrics import restricted_mean
from training.metrics.plain import finite
from training.report.run_folder import write_json
from training.stimuli import Thesis
from training.studies.ablation_inputs import columns, read, read_features, training_set
from training.studies.ablation_network import (
    ARCHITECTURES,
    AblationTraining,
    Architecture,
    FaultyLanes,
)
from training.studies.ablation_trials import (
    TrialFeatures,
    assessed,
    diagnoser_outcome,
    faulty_truth,
    network_outcomes,
    simulated,
    trials_of,
)

VALIDATION_SETS = 2
VALIDATION_LANES = 512  # with one fault each
REPORTS = 10  # of the progress in each pass over the episodes
CHOSEN_ON = "raw and filters"  # inputs on which the architecture is chosen
PASSES_OF_CHOICE = 1


@dataclass(frozen=True)
class AblationRuns:
    """All computations of one ablation.

    Attributes
    ----------
    cache
        Folder of the files.
    sets
        Sets of training episodes, `training.learning.episode_sets.LANES` each.
    passes
        How often a network is trained over them.
    hours
        Healthy operation to set thresholds on, and as much to count false alarms on [h].
    every
        k: each k-th faulty episode of the suite `standard`.
    workers
        Processes, as joblib has them.
    seed
        Of the first network; the others have the next ones.
    """

    cache: Path
    sets: int
    passes: int
    hours: float
    every: int
    workers: int
    seed: int

    @cached_property
    def plan(self) -> BenchmarkPlan:
        """The suite `standard` under the thesis' stimulus."""
        suite = suites.load(suites.STANDARD)
        hours = {THRESHOLD: self.hours, COUNTING: self.hours}
        return BenchmarkPlan(suite, suite.conditions, (Thesis(),), hours, self.every)

    @cached_property
    def episodes(self) -> list[Path]:
        """Files of the training episodes."""
        jobs = [partial(training_set, self.cache, "training", k) for k in range(self.sets)]
        return self._all(jobs, "training episodes")

    @cached_property
    def validation(self) -> list[Path]:
        """Files of the validation episodes."""
        numbers = range(VALIDATION_SETS)
        jobs = [partial(training_set, self.cache, "validation", k) for k in numbers]
        return self._all(jobs, "validation episodes")

    @cached_property
    def validation_trials(self) -> list[TrialFeatures]:
        """Validation lanes with one fault each."""
        suite = validation_suite(VALIDATION_LANES, 0)
        plan = BenchmarkPlan(suite, suite.conditions, (Thesis(),), {THRESHOLD: 0.1, COUNTING: 0.1})
        trials = [trial for trial in trials_of(plan) if trial.part == FAULTY]
        return self._all(
            [partial(simulated, self.cache, one) for one in trials], "validation lanes"
        )

    @cached_property
    def trials(self) -> list[TrialFeatures]:
        """The lanes that are scored."""
        jobs = [partial(simulated, self.cache, trial) for trial in trials_of(self.plan)]
        return self._all(jobs, "test lanes")

    def simulate(self) -> None:
        """All episodes and lanes as features, so that the networks find them."""
        for name in ("episodes", "validation", "validation_trials", "trials"):
            getattr(self, name)

    def architecture(self) -> tuple[Architecture, dict[str, float]]:
        """The architecture with the least validation loss, and the losses of all by name."""
        jobs = [partial(self._loss_of, one) for one in ARCHITECTURES]
        losses = self._all(jobs, "architectures")
        best = ARCHITECTURES[int(np.argmin(losses))]
        names = map(str, ARCHITECTURES)
        return best, dict(zip(names, losses, strict=True))

    def networks(self, architecture: Architecture, jobs: Sequence[tuple[str, int]]) -> list[Any]:
        """What each network does, by its inputs and seed."""
        return self._all([partial(self._network, architecture, *job) for job in jobs], "networks")

    def diagnoser(self, name: str) -> dict[str, Any]:
        """What a diagnoser of the registry does on the same lanes."""

        def compute() -> dict[str, Any]:
            trials = self.plan.trials([Entrant(name, partial(make, name))])
            jobs = [partial(diagnoser_outcome, trial) for trial in trials]
            outcomes = self._all(jobs, name)
            parts = [trial.part for trial in trials]
            return figures(assessed(parts, outcomes, faulty_truth(self.trials)))

        return self._kept(("diagnoser", name), compute)

    def _loss_of(self, architecture: Architecture) -> float:
        """Validation loss after a short training."""

        def compute() -> list[float]:
            training = AblationTraining(CHOSEN_ON, architecture, self.seed)
            *_, last = self._progress(training, PASSES_OF_CHOICE, CHOSEN_ON)
            return [last.validation_loss]

        return self._kept(("architecture", str(architecture)), compute)[0]

    def _network(self, architecture: Architecture, inputs: str, seed: int) -> dict[str, Any]:
        """Progress of the training of a network, and what it does."""

        def compute() -> dict[str, Any]:
            training = AblationTraining(inputs, architecture, seed)
            progress = list(self._progress(training, self.passes, inputs))
            chosen = columns(inputs)
            outcomes = network_outcomes(training.log_probability, chosen, self.trials)
            parts = [trial.part for trial in self.trials]
            assessment = assessed(parts, outcomes, faulty_truth(self.trials))
            history = [one._asdict() for one in progress]
            return {"inputs": inputs, "seed": seed, "history": history} | figures(assessment)

        return self._kept(("network", str(architecture), inputs, seed), compute)

    def _progress(self, training: AblationTraining, passes: int, inputs: str):
        chosen = columns(inputs)
        truth = faulty_truth(self.validation_trials)
        paths = [trial.path for trial in self.validation_trials]
        features = read_features(paths, chosen)
        faulty = FaultyLanes.at(features, truth.fault, truth.onset + DECISION_TIME)
        with one_thread():
            yield from training.run(
                read(self.episodes, chosen),
                read(self.validation, chosen),
                faulty,
                passes,
                REPORTS,
            )

    def _kept(self, of: tuple[Any, ...], compute: Callable[[], Any]) -> Any:
        """A result as plain data, from its file or computed."""
        made_from = (of, self.sets, self.passes, self.hours, self.every, digest(Path(__file__)))
        key = hashlib.sha256(repr(made_from).encode()).hexdigest()[:20]
        path = self.cache / f"{of[0]}-{key}.json"
        if not path.exists():
            write_json(path, compute())
        return json.loads(path.read_text(encoding="utf-8"))

    def _all(self, jobs: Sequence[Callable[[], Any]], name: str) -> list[Any]:
        """The results of all jobs, in their order, with a progress bar."""
        done = Parallel(n_jobs=self.workers, return_as="generator")(delayed(job)() for job in jobs)
        return list(tqdm(done, desc=name, total=len(jobs)))


def figures(assessment: Assessment) -> dict[str, Any]:
    """What the tables need of an assessment, as plain data; by faulty lane what is a list."""
    isolation = assessment.isolation
    detection = assessment.detection
    return {
        "isolation": isolation.time.tolist(),
        "isolated": (~isolation.censored).tolist(),
        "detection": detection.time.tolist(),
        "decision": assessment.decision.tolist(),
        "label": assessment.label.tolist(),
        "restricted_mean": restricted_mean(isolation),
        "ece": calibration_error(assessment),
        "threshold": finite(assessment.threshold),
        "false_alarms": assessment.false_alarms,
        "hours": assessment.hours,
    }
