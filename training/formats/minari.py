"""Simulated episodes as a Minari data set; the truth is in the infos.

It lies within the run, in the layout of `minari.load_dataset`: set MINARI_DATASETS_PATH to
``OUTPUT/minari``. The metadata of an episode hold seed and reset options, with which the
environment that the data set recovers repeats it exactly. Minari determines the size of all files
after every episode, so thousands of episodes take long.
"""

import copy
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from auv_fault_env.actions import ACTIONS
from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import finite_in_range
from auv_fault_env.missions import Mission
from auv_fault_env.parameters import SAMPLE_RATE
from auv_fault_env.schedules import Schedule, to_json
from training.arguments import Simulate
from training.extras import import_from_extra

FORMAT = "minari"
USER = f"`--formats {FORMAT}`"
DATASET = "propulsion-faults-v0"
ENVIRONMENT = "auv_fault_env/Propulsion-v0"
LONGEST = 13_000.0  # s: Minari reads an episode in one piece of at most 131072 rows
DESCRIPTION = (
    "Episodes of an autonomous underwater vehicle whose propulsion may fail; truth_ is for scoring."
)


def new_storage(
    folder: Path, arguments: Simulate, distributions: Mapping[str, dict[str, Any]]
) -> Any:
    """An empty `minari.dataset.minari_storage.MinariStorage` in ``folder/minari``, in Parquet.

    `distributions` are those of schedules and missions as the environment takes them.
    """
    minari = import_from_extra("minari.dataset.minari_storage", "formats", USER)
    finite_in_range("duration of Minari's episodes", arguments.duration, 1 / SAMPLE_RATE, LONGEST)
    path = folder / FORMAT / DATASET / "data"
    path.parent.mkdir(parents=True)
    env_spec = environment(arguments, distributions)
    storage = minari.MinariStorage.new(path, env_spec=env_spec, data_format="parquet")
    about = {
        "dataset_id": DATASET,
        "minari_version": version("minari"),
        "description": DESCRIPTION,
        "algorithm_name": "the mission's speed",
        "requirements": ["auv-fault"],
    }
    storage.update_metadata(about)
    return storage


def environment(
    arguments: Simulate, distributions: Mapping[str, dict[str, Any]]
) -> gym.envs.registration.EnvSpec:
    """The environment that makes these episodes."""
    spec = copy.deepcopy(gym.spec(ENVIRONMENT))
    spec.max_episode_steps = round(arguments.duration * SAMPLE_RATE)
    names = ("preset", "sensor_noise", "disturbance", "healthy_band", "realism")
    spec.kwargs = {name: getattr(arguments, name) for name in names} | distributions
    spec.kwargs["truth"] = "full"
    return spec


def episodes(
    columns: Mapping[str, np.ndarray],
    seeds: Iterable[int],
    schedules: Iterable[Schedule],
    mission: Mission | None,
) -> Iterator[Any]:
    """A `minari.data_collector.EpisodeBuffer` per lane.

    `columns` are channels and truth, (n_steps + 1, n_lanes) each, the first sample at the start;
    `mission` is None if each lane has sampled its own.
    """
    buffer = import_from_extra("minari.data_collector.episode_buffer", "formats", USER)
    observations = np.stack([columns[name] for name in CHANNELS], axis=-1)
    actions = np.stack([columns[name] for name in ACTIONS], axis=-1)
    infos = dict(columns)
    for name in (*CHANNELS, "truth_reward"):
        del infos[name]
    common_options = {} if mission is None else {"mission": asdict(mission)}
    is_last = np.arange(1, len(observations)) == len(observations) - 1
    for lane, (seed, schedule) in enumerate(zip(seeds, schedules, strict=True)):
        yield buffer.EpisodeBuffer(
            seed=int(seed),
            options={"schedule": json.loads(to_json(schedule))} | common_options,
            observations=observations[:, lane],
            # the commands during the sample that ends with the reading
            actions=actions[1:, lane],
            rewards=columns["truth_reward"][1:, lane],
            terminations=np.zeros_like(is_last),
            truncations=is_last.copy(),
            infos={name: values[:, lane].tolist() for name, values in infos.items()},
        )
