"""Suites of episodes that everybody is scored on: frozen JSON files, each sealed with a hash over all of its text.

A file has the conditions under which all of its vehicles run, the first seeds of healthy ones, and
a line per faulty episode: seed, fault events, mission legs (start [s], speed [m/s]), speed at the
start [m/s]. A suite of your own has the same form; ``python -m training.benchmark.freeze_suites
FILE`` seals it.
"""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auv_fault_env.channels import MAXIMUM_DEFLECTION
from auv_fault_env.errors import InputError, finite_in_range, known_name, refusal, whole_number
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission, MissionSampler
from auv_fault_env.noise import STREAMS, episode_keys, uniforms
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import Schedule, ScheduleSampler, schedule_of, to_json
from training.metrics.records import HORIZON
from training.rollouts import square_waves
from training.seeds import purpose_of

FOLDER = Path(__file__).parent / "suites"
NAMES = (
    "thesis",
    "standard",
    "ood_noise",
    "ood_disturbance",
    "ood_vehicle",
    "ood_severity",
    "ood_compound",
    "ood_mission",
)
STANDARD = "standard"  # its conditions are those that the thresholds are set under
# one permanent fault per lane, every class equally likely
ONE_FAULT = ScheduleSampler(healthy=0.0, compound=0.0, intermittent=0.0, repaired=0.0)
HEALTHY_PARTS = ("threshold", "counting")
COLUMNS = ("seed", "faults", "legs", "start_speed")
LAST_STAND_IN_ONSET = 30.0  # s, latest instant that stands for an onset on healthy lanes
NAME = re.compile(r"[\w-]{1,60}")
LARGEST_SEED = 2**62  # leaves room for healthy lanes after it
CLOSING = re.compile(r' "hash": "([0-9a-f]{64})"\n}\n\Z')


@dataclass(frozen=True)
class Steering:
    """Rudder and stern plane: a share of the lanes swings each of them, up to `deflection` [rad]."""

    share: float
    deflection: float

    def __post_init__(self):
        finite_in_range("share of steered lanes", self.share, 0.0, 1.0)
        finite_in_range("deflection", self.deflection, 0.0, MAXIMUM_DEFLECTION)


@dataclass(frozen=True)
class Conditions:
    """What the vehicles of a suite run under.

    Attributes
    ----------
    plant
        Arguments of `Fleet`: preset, sensor_noise, disturbance, healthy_band.
    duration
        Of an episode [s].
    missions
        Distributions of the missions of healthy lanes, taken in turn by the seed.
    steering
        Rudder and stern plane of all lanes.
    """

    plant: Mapping[str, Any]
    duration: float
    missions: tuple[MissionSampler, ...]
    steering: Steering

    def __post_init__(self):
        finite_in_range(
            "duration", self.duration, LAST_STAND_IN_ONSET + HORIZON + SAMPLE_TIME, 3600.0
        )
        if not self.missions:
            raise refusal(
                "missions",
                self.missions,
                "at least one",
                "give the distribution of healthy lanes' missions",
            )
        Fleet(1, **self.plant)

    @property
    def n_samples(self) -> int:
        """Samples of an episode."""
        return round(self.duration / SAMPLE_TIME)

    def deflections(self, seeds: Sequence[int]) -> np.ndarray:
        """Rudder and stern plane [rad] of the lanes with these seeds, (n_samples, n_lanes, 2): square waves."""
        u = uniforms(keys(seeds), STREAMS["steering"], 7)
        steered = u[:, :1] < self.steering.share
        half = 2.0 + 10.0 * u[:, 3:5]
        phase = 24.0 * u[:, 5:7]
        return square_waves(
            self.steering.deflection * steered * u[:, 1:3], half, phase, self.n_samples
        )

    def draw_missions(self, seeds: Sequence[int]) -> list[Mission]:
        """Missions of healthy lanes with these seeds."""
        drawn = [sampler.sample_legs(keys(seeds)) for sampler in self.missions]
        turns = [(*drawn[seed % len(drawn)], lane) for lane, seed in enumerate(seeds)]
        return [
            Mission(tuple(map(tuple, legs[lane].tolist())), float(starts[lane]))
            for legs, starts, lane in turns
        ]


class Episode(NamedTuple):
    """A lane: the seed of its vehicle and noise, its faults, its mission."""

    seed: int
    schedule: Schedule
    mission: Mission


@dataclass(frozen=True)
class Suite:
    """Faulty episodes, and where the seeds of healthy lanes begin, by part: to set thresholds, to count alarms.

    `hash` is that of the file; a suite that comes from no file has none.
    """

    name: str
    about: str
    conditions: Conditions
    healthy: Mapping[str, int]
    episodes: tuple[Episode, ...]
    hash: str = ""

    def __post_init__(self):
        if not isinstance(self.name, str) or not NAME.fullmatch(self.name):
            raise refusal(
                "name", self.name, "letters, digits, hyphens and underscores", "take another"
            )
        if not self.episodes:
            raise refusal("episodes", self.episodes, "at least one", "give a faulty episode")
        for part in HEALTHY_PARTS:
            _own_seed(f"first seed of {part}", self.healthy.get(part))
        for episode in self.episodes:
            _own_seed("seed of an episode", episode.seed)
            _checked_onset(episode, self.conditions.duration - HORIZON - SAMPLE_TIME)

    def text(self) -> str:
        """The file."""
        conditions = asdict(self.conditions)
        header = {
            "name": self.name,
            "about": self.about,
            **conditions,
            "healthy": self.healthy,
            "columns": COLUMNS,
        }
        lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in header.items()]
        rows = ",\n".join(f"  {json.dumps(_row(episode))}" for episode in self.episodes)
        return sealed("\n".join(["{", *lines, f' "episodes": [\n{rows}\n ],', ""]))


def _own_seed(thing: str, seed: Any) -> None:
    if whole_number(thing, seed, 0) > LARGEST_SEED or purpose_of(seed) not in ("test", None):
        raise refusal(
            thing,
            seed,
            f"up to {LARGEST_SEED}, none that diagnosers are trained on",
            "take a test seed",
        )


def _checked_onset(episode: Episode, last: float) -> None:
    thing = f"faults of the episode with seed {episode.seed}"
    if not any(event.severity > 0.0 for event in episode.schedule):
        raise refusal(thing, episode.schedule, "at least one, its severity above 0", "name a fault")
    finite_in_range(
        f"{thing}, first onset", min(event.onset for event in episode.schedule), SAMPLE_TIME, last
    )


def _row(episode: Episode) -> list[Any]:
    faults = json.loads(to_json(episode.schedule))
    return [episode.seed, faults, episode.mission.legs, episode.mission.start_speed]


def digest(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def sealed(body: str) -> str:
    """The text of a file up to its hash, and the hash."""
    return f'{body} "hash": "{digest(body)}"\n}}\n'


def keys(seeds: Sequence[int]) -> np.ndarray:
    """Noise keys of the first episodes of these seeds, (n_lanes,)."""
    return episode_keys(np.array(seeds, np.uint64), np.zeros(len(seeds), np.uint64))


def load(suite: str) -> Suite:
    """A suite by its name, or from the path of a file; one that is not as it was sealed is refused in one line."""
    own = suite.endswith(".json")
    path = (
        Path(suite) if own else FOLDER / f"{known_name('suite', suite, [*NAMES, 'FILE.json'])}.json"
    )
    text = read(path)
    closing = CLOSING.search(text)
    body, wanted = (text[: closing.start()], closing[1]) if closing else (text, "none at its end")
    if digest(body) != wanted:
        remedy = (
            f"restore the file, or seal it with python -m training.benchmark.freeze_suites {path}"
        )
        raise refusal(
            f"suite {path}, hash of its text", digest(body), f"that written in it, {wanted}", remedy
        )
    return parse(text, path)


def read(path: Path) -> str:
    """The text of a suite's file."""
    try:
        return path.read_bytes().decode()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise refusal(
            "suite", str(path), "a readable file of a suite", f"check the path ({reason})"
        ) from None


def parse(text: str, origin: Path) -> Suite:
    """The suite of a JSON text, its hash taken as it is; what is no suite is refused with the place."""
    try:
        content = json.loads(text)
        conditions = Conditions(
            content["plant"],
            content["duration"],
            tuple(MissionSampler(**fields) for fields in content["missions"]),
            Steering(**content["steering"]),
        )
        episodes = tuple(_episode(row) for row in content["episodes"])
        about = content["name"], content["about"]
        return Suite(*about, conditions, content["healthy"], episodes, content.get("hash", ""))
    except InputError as error:
        raise InputError(f"suite {origin}: {error}") from None
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        shown = f"{type(error).__name__}: {error}"
        raise refusal(
            f"suite {origin}", shown, "a file like those in training/suites", "mend that place"
        ) from None


def _episode(row: Sequence[Any]) -> Episode:
    seed, faults, legs, start_speed = row
    return Episode(seed, schedule_of(faults), Mission(tuple(map(tuple, legs)), start_speed))
