"""What the ablation computes: features, networks and what these do, each kept in a file.

A run that was stopped takes from the files what it has finished. Their names hold a digest of the
code and of the settings.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env.compiling import digest
from diagnosers import make
from training.benchmark import suites
from training.benchmark.assessment import DECISION_TIME, Assessment
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.scores import calibration_error
from training.benchmark.trials import COUNTING, THRESHOLD, Entrant
from training.benchmark.validation_suite import validation_suite
from training.learning.reproducible import one_thread
from training.metrics import restricted_mean
from training.metrics.plain import finite
from training.report.run_folder import write_json
from training.stimuli import Thesis
from training.studies.ablation_inputs import read, read_features, training_set
from training.studies.ablation_network import (
    ARCHITECTURES,
    AblationTraining,
    Architecture,
    DecidedLanes,
    Progress,
)
from training.studies.ablation_trials import (
    WITHOUT_DIAGNOSER,
    TrialFeatures,
    assessed,
    diagnoser_outcome,
    faulty_trials,
    faulty_truth,
    network_outcomes,
    simulated,
)

VALIDATION_SETS = 2
VALIDATION_LANES = 512  # with one fault each
REPORTS = 10  # of the progress in each pass over the episodes
CHOSEN_ON = "raw and filters"  # inputs on which the architecture is chosen
PASSES_OF_CHOICE = 1


class Files(NamedTuple):
    """Where the features are."""

    training: list[Path]
    validation: list[Path]
    faulty_validation: list[TrialFeatures]  # lanes with one fault each
    test: list[TrialFeatures]  # lanes that are scored


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

    def simulate(self) -> Files:
        """All episodes and lanes as features."""
        training = [partial(training_set, self.cache, "training", k) for k in range(self.sets)]
        numbers = range(VALIDATION_SETS)
        validation = [partial(training_set, self.cache, "validation", k) for k in numbers]
        faulty = faulty_trials(validation_suite(VALIDATION_LANES, 0), Thesis())
        faulty_validation = [partial(simulated, self.cache, trial) for trial in faulty]
        test = [
            partial(simulated, self.cache, trial) for trial in self.plan.trials([WITHOUT_DIAGNOSER])
        ]
        return Files(
            self._all(training, "training episodes"),
            self._all(validation, "validation episodes"),
            self._all(faulty_validation, "faulty validation lanes"),
            self._all(test, "test lanes"),
        )

    def architecture(self, files: Files) -> tuple[Architecture, dict[str, float]]:
        """The architecture with the least validation loss, and the losses of all by name."""
        jobs = [partial(self._loss_of, files, one) for one in ARCHITECTURES]
        losses = self._all(jobs, "architectures")
        best = ARCHITECTURES[int(np.argmin(losses))]
        names = map(str, ARCHITECTURES)
        return best, dict(zip(names, losses, strict=True))

    def networks(
        self, files: Files, architecture: Architecture, jobs: Sequence[tuple[str, int]]
    ) -> list[Any]:
        """What each network does, by its inputs and seed."""
        work = [partial(self._network, files, architecture, *job) for job in jobs]
        return self._all(work, "networks")

    def diagnoser(self, files: Files, name: str) -> dict[str, Any]:
        """What a diagnoser of the registry does on the same lanes."""

        def compute() -> dict[str, Any]:
            trials = self.plan.trials([Entrant(name, partial(make, name))])
            outcomes = self._all([partial(diagnoser_outcome, trial) for trial in trials], name)
            parts = [trial.part for trial in trials]
            return figures(assessed(parts, outcomes, faulty_truth(files.test)))

        return self._kept(("diagnoser", name), compute)

    def _loss_of(self, files: Files, architecture: Architecture) -> float:
        """Validation loss after a short training."""

        def compute() -> float:
            training = AblationTraining(CHOSEN_ON, architecture, self.seed)
            *_, last = progress_of(training, files, PASSES_OF_CHOICE)
            return last.validation_loss

        return self._kept(("architecture", str(architecture), self.seed), compute)

    def _network(
        self, files: Files, architecture: Architecture, inputs: str, seed: int
    ) -> dict[str, Any]:
        """Progress of the training of a network, and what it does."""

        def compute() -> dict[str, Any]:
            training = AblationTraining(inputs, architecture, seed)
            history = [one._asdict() for one in progress_of(training, files, self.passes)]
            outcomes = network_outcomes(training, files.test)
            parts = [trial.part for trial in files.test]
            assessment = assessed(parts, outcomes, faulty_truth(files.test))
            return {"inputs": inputs, "seed": seed, "history": history} | figures(assessment)

        return self._kept(("network", str(architecture), inputs, seed), compute)

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


def progress_of(training: AblationTraining, files: Files, passes: int) -> Iterator[Progress]:
    """Train a network on one thread, and yield its progress."""
    truth = faulty_truth(files.faulty_validation)
    paths = [trial.path for trial in files.faulty_validation]
    features = read_features(paths, training.columns)
    faulty = DecidedLanes.at(features, truth.fault, truth.onset + DECISION_TIME)
    with one_thread():
        yield from training.run(
            read(files.training, training.columns),
            read(files.validation, training.columns),
            faulty,
            passes,
            REPORTS,
        )


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
