"""Suites of episodes: frozen JSON files, each sealed with a hash over all of its text.

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
from auv_fault_env.errors import (
    InputError,
    finite_in_range,
    known_name,
    refusal,
    whole_number,
)
from auv_fault_env.fleet import Fleet
from auv_fault_env.missions import Mission, MissionSampler
from auv_fault_env.noise import STREAMS, episode_keys, uniforms
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.schedules import Schedule, ScheduleSampler, schedule_of, to_json
from auv_fault_env.text_files import text_of
from training.benchmark.whole_missions import WholeMissionSampler
from training.known_names import SUITES
from training.metrics.records import HORIZON
from training.rollouts import square_waves
from training.seeds import purpose_of

FOLDER = Path(__file__).parent / "suites"
NAMES = SUITES
STANDARD = "standard"  # its conditions are those that the thresholds are set under
IDEAL = "ideal"  # its vehicles are those of the diagnosers' models, and of the bounds
# one permanent fault per lane, every class equally likely
ONE_FAULT = ScheduleSampler(healthy=0.0, compound=0.0, intermittent=0.0, repaired=0.0)
HEALTHY_PARTS = ("threshold", "counting")
COLUMNS = ("seed", "faults", "legs", "start_speed")
# s, from the latest instant that stands for an onset on a healthy lane to its end
AFTER_STAND_IN_ONSET = HORIZON + 5.0
LAST_STAND_IN_ONSET = 30.0  # s, that of the shortest episodes
NAME = re.compile(r"[\w-]{1,60}")
LARGEST_SEED = 2**62  # leaves room for healthy lanes after it
CLOSING = re.compile(r' "hash": "([0-9a-f]{64})"\n}\n\Z')


@dataclass(frozen=True)
class Steering:
    """A share of the lanes swings rudder and stern plane by up to `deflection` [rad]."""

    share: float
    deflection: float

    def __post_init__(self):
        finite_in_range("share of steered lanes", self.share, 0.0, 1.0)
        finite_in_range("deflection", self.deflection, 0.0, MAXIMUM_DEFLECTION)


@dataclass(frozen=True)
class Conditions:
    """What the vehicles of a suite run under."""

    plant: Mapping[str, Any]  # for `Fleet`: preset, sensor_noise, healthy_band, realism, ...
    duration: float  # of a faulty episode [s]
    missions: tuple[MissionSampler, ...]  # of so long episodes, taken in turn by the seed
    steering: Steering  # of all lanes
    # missions of healthy lanes, each with its own duration; None: as those of faulty lanes
    whole_missions: WholeMissionSampler | None = None

    def __post_init__(self):
        shortest = LAST_STAND_IN_ONSET + HORIZON + SAMPLE_TIME
        finite_in_range("duration", self.duration, shortest, 3600.0)
        if not self.missions:
            remedy = "give the distribution of healthy lanes' missions"
            raise refusal("missions", self.missions, "at least one", remedy)
        Fleet(1, **self.plant)

    @property
    def n_samples(self) -> int:
        """Samples of a faulty episode."""
        return round(self.duration / SAMPLE_TIME)

    def deflections(self, seeds: Sequence[int], samples: np.ndarray) -> np.ndarray:
        """Square waves of rudder and stern plane [rad] by seed, (n_samples, n_lanes, 2).

        samples (n_samples,) are their numbers from the start.
        """
        uniform = uniforms(noise_keys(seeds), STREAMS["steering"], 7)
        is_steered = uniform[:, :1] < self.steering.share
        amplitude = self.steering.deflection * is_steered * uniform[:, 1:3]
        half_period = 2.0 + 10.0 * uniform[:, 3:5]
        phase = 24.0 * uniform[:, 5:7]
        return square_waves(amplitude, half_period, phase, samples)

    def sample_missions(self, seeds: Sequence[int]) -> list[Mission]:
        """Missions of faulty lanes with these seeds."""
        missions = []
        sampled = [sampler.sample_legs(noise_keys(seeds)) for sampler in self.missions]
        for lane, seed in enumerate(seeds):
            legs, start_speeds = sampled[seed % len(sampled)]
            lane_legs = tuple(map(tuple, legs[lane].tolist()))
            missions.append(Mission(lane_legs, float(start_speeds[lane])))
        return missions

    def healthy_episodes(self, seeds: Sequence[int]) -> list["Episode"]:
        """Healthy lanes with these seeds."""
        if self.whole_missions is None:
            missions = self.sample_missions(seeds)
            return [Episode(seed, (), one) for seed, one in zip(seeds, missions, strict=True)]
        whole = self.whole_missions.sample(noise_keys(seeds))
        return [
            Episode(seed, (), one.mission, one.duration)
            for seed, one in zip(seeds, whole, strict=True)
        ]

    def lengths(self, episodes: Sequence["Episode"]) -> np.ndarray:
        """Samples of each episode, (n_lanes,)."""
        durations = [
            self.duration if episode.duration is None else episode.duration for episode in episodes
        ]
        return np.round(np.array(durations) / SAMPLE_TIME).astype(np.int64)

    def durations(self, seeds: Sequence[int]) -> np.ndarray:
        """Durations of the healthy lanes with these seeds [s], (n_lanes,)."""
        if self.whole_missions is None:
            return np.full(len(seeds), self.duration)
        return self.whole_missions.durations(noise_keys(seeds))


class Episode(NamedTuple):
    """A lane: the seed of its vehicle and noise, its faults, its mission."""

    seed: int
    schedule: Schedule
    mission: Mission
    duration: float | None = None  # s; that of the conditions if None


@dataclass(frozen=True)
class Suite:
    """A list of faulty episodes with their conditions, and the seeds of healthy lanes."""

    name: str
    about: str  # one line on its content
    conditions: Conditions
    healthy: Mapping[str, int]  # first seed of the healthy lanes of each of `HEALTHY_PARTS`
    episodes: tuple[Episode, ...]  # the faulty ones
    hash: str = ""  # of its file; empty if it is in none
    purpose: str = "test"  # of its seeds; those of users are allowed as well

    def __post_init__(self):
        if not isinstance(self.name, str) or not NAME.fullmatch(self.name):
            allowed = "letters, digits, hyphens and underscores"
            raise refusal("name", self.name, allowed, "take another")
        if not self.episodes:
            raise refusal("episodes", self.episodes, "at least one", "give a faulty episode")
        for part in HEALTHY_PARTS:
            _check_seed(f"first seed of {part}", self.healthy.get(part), self.purpose)
        last_onset = self.conditions.duration - HORIZON - SAMPLE_TIME
        for episode in self.episodes:
            _check_seed("seed of an episode", episode.seed, self.purpose)
            _check_faults(episode, last_onset)

    @property
    def content_hash(self) -> str:
        """The hash of its content, whether it is in a file or not."""
        return digest(self._body())

    def text(self) -> str:
        """The file: all of its content, and the hash of that."""
        return sealed(self._body())

    def _body(self) -> str:
        conditions = asdict(self.conditions)
        if self.conditions.whole_missions is None:
            del conditions["whole_missions"]
        header = {
            "name": self.name,
            "about": self.about,
            **conditions,
            "healthy": self.healthy,
            "columns": COLUMNS,
        }
        lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in header.items()]
        rows = ",\n".join(f"  {json.dumps(_row(episode))}" for episode in self.episodes)
        return "\n".join(["{", *lines, f' "episodes": [\n{rows}\n ],', ""])


def _check_seed(thing: str, seed: Any, purpose: str) -> None:
    is_too_large = whole_number(thing, seed, 0) > LARGEST_SEED
    if is_too_large or purpose_of(seed) not in (purpose, None):
        allowed = f"up to {LARGEST_SEED}, none that diagnosers are trained on"
        raise refusal(thing, seed, allowed, f"take a {purpose} seed")


def _check_faults(episode: Episode, last_onset: float) -> None:
    thing = f"faults of the episode with seed {episode.seed}"
    if not any(event.severity > 0.0 for event in episode.schedule):
        raise refusal(
            thing,
            episode.schedule,
            "at least one, its severity above 0",
            "name a fault",
        )
    first_onset = min(event.onset for event in episode.schedule)
    finite_in_range(f"{thing}, first onset", first_onset, SAMPLE_TIME, last_onset)


def _row(episode: Episode) -> list[Any]:
    faults = json.loads(to_json(episode.schedule))
    return [episode.seed, faults, episode.mission.legs, episode.mission.start_speed]


def digest(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def sealed(body: str) -> str:
    """The text of a file: its body, and the hash of that."""
    return f'{body} "hash": "{digest(body)}"\n}}\n'


def noise_keys(seeds: Sequence[int]) -> np.ndarray:
    """Noise keys of the first episodes of these seeds, (n_lanes,)."""
    return episode_keys(np.array(seeds, np.uint64), np.zeros(len(seeds), np.uint64))


def load(suite: str) -> Suite:
    """A suite by its name or file; a file that does not match its hash is refused."""
    if suite.endswith(".json"):
        path = Path(suite)
    else:
        name = known_name("suite", suite, [*NAMES, "FILE.json"])
        path = FOLDER / f"{name}.json"
    text = read(path)
    body = text
    written_hash = "none at its end"
    closing = CLOSING.search(text)
    if closing:
        body = text[: closing.start()]
        written_hash = closing[1]
    if digest(body) != written_hash:
        thing = f"suite {path}, hash of its text"
        allowed = f"that written in it, {written_hash}"
        sealing = f"python -m training.benchmark.freeze_suites {path}"
        raise refusal(
            thing,
            digest(body),
            allowed,
            f"restore the file, or seal it with {sealing}",
        )
    return parse(text, path)


def read(path: Path) -> str:
    """The text of a suite's file."""
    return text_of(path, "suite", "a readable file of a suite")


def parse(text: str, origin: Path) -> Suite:
    """The suite of a JSON text, its hash not checked; any other text is refused."""
    try:
        content = json.loads(text)
        missions = [MissionSampler(**fields) for fields in content["missions"]]
        steering = Steering(**content["steering"])
        whole = content.get("whole_missions")
        whole_missions = None if whole is None else WholeMissionSampler(**whole)
        return Suite(
            content["name"],
            content["about"],
            Conditions(
                content["plant"],
                content["duration"],
                tuple(missions),
                steering,
                whole_missions,
            ),
            content["healthy"],
            tuple(_episode(row) for row in content["episodes"]),
            content.get("hash", ""),
        )
    except InputError as error:
        raise InputError(f"suite {origin}: {error}") from None
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
        shown = f"{type(error).__name__}: {error}"
        allowed = "a file like those in training/benchmark/suites"
        raise refusal(f"suite {origin}", shown, allowed, "correct that place") from None


def _episode(row: Sequence[Any]) -> Episode:
    seed, faults, legs, start_speed = row
    return Episode(seed, schedule_of(faults), Mission(tuple(map(tuple, legs)), start_speed))
