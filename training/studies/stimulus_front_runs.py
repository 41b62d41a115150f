"""The runs behind the front of stimuli: batched closed loops of each point, kept on disk.

A point is a stimulus at a strength, its budget [m/s]. All points run on the same vehicles. The name
of a kept file holds all that its content depends on, so that a study that was stopped goes on, and
another stimulus, strength or more vehicles run alone.
"""

import hashlib
import inspect
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from auv_fault_env import fleet
from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.compiling import digest
from auv_fault_env.errors import finite_in_range, known_name, refusal
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import events_of, first_onset
from diagnosers import make
from training.benchmark import trial_store, trials
from training.benchmark.suites import Conditions, Episode, Suite
from training.benchmark.trials import COUNTING, FAULTY, LANES_PER_TRIAL, THRESHOLD, Entrant
from training.benchmark.workers import with_catalogue
from training.metrics.records import concatenate_lanes
from training.stimuli import STIMULI, Stimulus
from training.stimuli.known_onset import NEVER, FasterFromOnset
from training.studies import stimulus_behaviour
from training.studies.stimulus_behaviour import record_closed_loop

DIAGNOSER = "filter_bank"
SEPARATOR = ":"
# seeds of healthy lanes that each seed of the study has for itself
SEED_BLOCK = 10_000


class Point(NamedTuple):
    """A stimulus at a strength."""

    stimulus: str
    strength: float  # budget [m/s]

    @property
    def label(self) -> str:
        """As the command line has it."""
        return f"{self.stimulus}{SEPARATOR}{self.strength:g}"


class FrontLanes(NamedTuple):
    """The vehicles that all points run on, by part: faulty, for counting, for thresholds."""

    conditions: Conditions
    episodes: Mapping[str, Sequence[Episode]]


class FrontRun(NamedTuple):
    """What a point keeps of its closed loop."""

    log_normal: np.ndarray  # (n_samples, n_lanes) log p(normal)
    top: np.ndarray  # (n_samples, n_lanes) most probable fault
    offset_mean: np.ndarray  # (n_lanes,) of the speed offset [m/s]
    offset_square: np.ndarray  # (n_lanes,) mean square of it [m^2/s^2]
    energy: np.ndarray  # (n_lanes,) [J]
    distance: np.ndarray  # (n_lanes,) through the water [m]


FrontRuns = Mapping[str, FrontRun]  # by part


class Job(NamedTuple):
    """One closed loop: a point on some of the lanes of a part."""

    point: Point
    part: str
    conditions: Conditions
    episodes: Sequence[Episode]

    @property
    def stimulus(self) -> Stimulus:
        """The stimulus of the point, for these episodes."""
        if self.point.stimulus != FasterFromOnset.name:
            return STIMULI[self.point.stimulus](self.point.strength)
        onset = first_onset(events_of([episode.schedule for episode in self.episodes]))
        onset = np.where(np.isfinite(onset), onset, NEVER)
        return FasterFromOnset(self.point.strength, onset=onset)


def point_of(text: str) -> Point:
    """A point from its text, `stimulus:strength`; anything else is refused."""
    name, _, strength = text.partition(SEPARATOR)
    known_name("stimulus of a point", name, [*STIMULI, FasterFromOnset.name])
    try:
        value = float(strength)
    except ValueError:
        allowed = "a stimulus, a colon and its budget [m/s]"
        raise refusal("point", text, allowed, "write thesis:0.05") from None
    return Point(name, finite_in_range(f"strength of {name}", value, 0.0, MAXIMUM_COMMAND))


def lanes_of(
    suite: Suite, names: Sequence[str], per_class: int, n_healthy: int, hours: float, seed: int
) -> FrontLanes:
    """Vehicles of a suite: faulty ones of it with these classes, and healthy ones of that length.

    Healthy vehicles run for as long as faulty ones, for that is what a budget counts over.
    """
    conditions = Conditions(**vars(suite.conditions) | {"whole_missions": None})
    faulty: list[Episode] = []
    for name in names:
        of_class = [one for one in suite.episodes if diagnosis_of(one) == name]
        if len(of_class) < per_class:
            allowed = f"up to {len(of_class)}, those of the suite {suite.name}"
            raise refusal("vehicles of a class", per_class, allowed, "take fewer")
        places = (seed * per_class + np.arange(per_class)) % len(of_class)
        faulty += [of_class[place] for place in places]
    counts = {COUNTING: n_healthy, THRESHOLD: math.ceil(3600.0 * hours / conditions.duration)}
    episodes: dict[str, Sequence[Episode]] = {FAULTY: faulty}
    for part, count in counts.items():
        seeds = _seeds(suite.healthy[part] + SEED_BLOCK * seed, count)
        episodes[part] = conditions.healthy_episodes(seeds)
    return FrontLanes(conditions, episodes)


def _seeds(first: int, count: int) -> range:
    if count > SEED_BLOCK:
        raise refusal("healthy vehicles", count, f"up to {SEED_BLOCK}", "take fewer")
    return range(first, first + count)


def diagnosis_of(episode: Episode) -> str:
    """The diagnosis class of the first fault of an episode."""
    return CATALOGUE[episode.schedule[0].fault].diagnosis


def jobs_of(point: Point, lanes: FrontLanes) -> list[Job]:
    """The closed loops of a point."""
    jobs = []
    for part, episodes in lanes.episodes.items():
        for first in range(0, len(episodes), LANES_PER_TRIAL):
            chosen = tuple(episodes[first : first + LANES_PER_TRIAL])
            jobs.append(Job(point, part, lanes.conditions, chosen))
    return jobs


def run_job(path: Path, job: Job) -> None:
    """Run a closed loop and write what is kept of it."""
    series = record_closed_loop(job.stimulus, DIAGNOSER, job.episodes, job.conditions)
    run = FrontRun(
        log_normal=series.log_normal.astype(np.float32),
        top=series.top.astype(np.int8),
        offset_mean=series.offset.mean(axis=0),
        offset_square=np.square(series.offset).mean(axis=0),
        energy=series.energy.sum(axis=0),
        distance=SAMPLE_TIME * series.speed.sum(axis=0),
    )
    trial_store.write(path, run)


def read_runs(
    folder: Path, points: Sequence[Point], lanes: FrontLanes, workers: int
) -> Iterator[tuple[Point, FrontRuns]]:
    """Run what is not in the folder yet, and read the runs of the points one after the other."""
    folder.mkdir(parents=True, exist_ok=True)
    paths: dict[Path, Job] = {}
    for point in points:
        paths |= {path_of(folder, job): job for job in jobs_of(point, lanes)}
    with trial_store.held_folder(folder):
        run_missing(paths, workers)
    for point in points:
        yield point, _read(point, paths)


def run_missing(jobs: Mapping[Path, Job], workers: int) -> None:
    """Run the closed loops whose files are not there."""
    faults = dict(CATALOGUE)
    missing = {path: job for path, job in jobs.items() if not path.exists()}
    calls = (delayed(with_catalogue)(faults, run_job, *one) for one in missing.items())
    done = Parallel(n_jobs=workers, return_as="generator_unordered")(calls)
    n_done = len(jobs) - len(missing)
    for _ in tqdm(done, total=len(jobs), initial=n_done, unit="run", desc="closed loops"):
        pass


def _read(point: Point, jobs: Mapping[Path, Job]) -> FrontRuns:
    of_part: dict[str, list[FrontRun]] = {}
    for path, job in jobs.items():
        if job.point == point:
            of_part.setdefault(job.part, []).append(trial_store.read_outcome(path, FrontRun))
    return {part: concatenate_lanes(runs) for part, runs in of_part.items()}


def path_of(folder: Path, job: Job) -> Path:
    """The file of a closed loop."""
    stimulus = job.stimulus
    made_from = (
        digest(Path(inspect.getsourcefile(type(stimulus))).resolve()),
        stimulus.policy_digest,
        loop_code(),
        list(CATALOGUE.values()),
        *job,
    )
    key = hashlib.sha256(repr(made_from).encode()).hexdigest()[:20]
    return folder / f"{job.point.stimulus}-{job.point.strength:g}-{job.part}-{key}.npz"


@cache
def loop_code() -> str:
    """What the closed loop depends on, but for the stimulus: plant, diagnoser, loop."""
    # their text alone: what they import includes every stimulus
    texts = [Path(module.__file__).read_bytes() for module in (trials, stimulus_behaviour)]
    entrant = Entrant(DIAGNOSER, partial(make, DIAGNOSER))
    bank = trial_store.fingerprint(entrant, make(DIAGNOSER))
    return repr((digest(Path(fleet.__file__)), bank, texts, inspect.getsource(run_job)))
