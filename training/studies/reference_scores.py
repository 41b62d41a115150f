"""What simple rules and a trained agent gain in `Propulsion-v0`, to compare other agents with.

Run ``python -m training.studies.reference_scores``. A score is the sum of the rewards of an
episode, with residual actions and charged fins. All agents have the same episodes, of the seeds
for tests; PPO learns on the seeds for training. The rule was tuned on the seeds for validation.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize
from tqdm import tqdm

from auv_fault_env.channels import INDEX
from auv_fault_env.errors import finite_in_range, whole_number
from training.learning.reproducible import one_thread, seeded_generators
from training.metrics.intervals import interval, paired_bootstrap
from training.report.sections import table_section
from training.sb3 import FleetVecEnv
from training.seeds import seeds
from training.studies.run import command_line, run_study

ENVIRONMENT = "auv_fault_env/Propulsion-v0"
SETTINGS = {"action": "residual", "reward_weights": {"deflection": 0.1}}
STEPS = 600  # of an episode
LANES = 64  # of a training
SEED_BLOCK = 10_000  # seeds of a training, of which each lane has one
MOST_SEED = 1000
# the hand rule: residual per m/s of the speed that lacks, and per m/s of the mission
CATCH_UP = 2.0
SLOWER = 0.3
DISCOUNT = 0.98
LEARNING_RATE = 3e-4  # at the start; it falls linearly to zero
HYPERPARAMETERS = {
    "learning_rate": lambda remaining: LEARNING_RATE * remaining,
    "n_steps": 128,
    "batch_size": 2048,
    "n_epochs": 5,
    "gamma": DISCOUNT,
}
LOG_STD = -2.0  # at the start: little exploration, as residuals of 1 leave the mission
# actions (n_lanes, 3) from observations (n_lanes, n_channels)
Policy = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class ReferenceScores:
    """Score simple rules and PPO on the same episodes."""

    episodes: int = 2000
    """Episodes that every agent is scored on."""
    steps: int = 400_000
    """Steps that PPO learns from."""
    trainings: int = 3
    """Trainings of PPO, each with other seeds."""
    seed: int = 0
    """Number of the first training."""
    output: Path = Path("runs/reference_scores")
    """Folder of the report; an earlier run there is replaced."""


def main(arguments: ReferenceScores) -> None:
    """Train, score, and write the table."""
    whole_number("episodes", arguments.episodes, 2)
    whole_number("steps", arguments.steps)
    whole_number("trainings", arguments.trainings, 0)
    finite_in_range("seed", arguments.seed, 0, MOST_SEED)
    run_study("reference_scores", arguments, lambda folder: study(arguments), page)


def follow(observation: np.ndarray) -> np.ndarray:
    """No residual: the mission speed, fins amidships."""
    return np.zeros((len(observation), 3))


def hand_rule(observation: np.ndarray) -> np.ndarray:
    """Somewhat slower than the mission, which saves energy, and more where speed lacks."""
    mission_speed = observation[:, INDEX["mission_speed"]]
    lacking = mission_speed - observation[:, INDEX["speed"]]
    actions = np.zeros((len(observation), 3))
    actions[:, 0] = np.clip(CATCH_UP * lacking - SLOWER * mission_speed, -1.0, 1.0)
    return actions


def random_policy(seed: int) -> Policy:
    """Actions drawn evenly from the whole space."""
    random = np.random.default_rng(seed)
    return lambda observation: random.uniform(-1.0, 1.0, (len(observation), 3))


def train(number: int, steps: int) -> tuple[Policy, float]:
    """A policy of PPO without exploration, and the processor time of its training [s]."""
    start = time.process_time()
    first = seeds("training", SEED_BLOCK, number * SEED_BLOCK)[0]
    fleet = vehicles(LANES, autoreset_mode="SameStep")
    normalised = VecNormalize(FleetVecEnv(fleet), gamma=DISCOUNT)
    with one_thread(), seeded_generators(first):
        model = PPO(
            "MlpPolicy",
            normalised,
            seed=first,  # of the lanes, too
            device="cpu",
            policy_kwargs={"log_std_init": LOG_STD},
            **HYPERPARAMETERS,
        )
        model.learn(steps)
    normalised.training = False

    def policy(observation: np.ndarray) -> np.ndarray:
        return model.predict(normalised.normalize_obs(observation), deterministic=True)[0]

    normalised.close()
    return policy, time.process_time() - start


def vehicles(n_lanes: int, **options: Any) -> gym.vector.VectorEnv:
    """The environment of all agents, without the truth in its information."""
    return gym.make_vec(
        ENVIRONMENT, n_lanes, "vector_entry_point", truth=False, **SETTINGS, **options
    )


def scores(policy: Policy, n_episodes: int) -> np.ndarray:
    """Sum of the rewards of each episode of the seeds for tests, (n_episodes,)."""
    env = vehicles(n_episodes)
    observation, _ = env.reset(seed=seeds("test", n_episodes)[0])
    total = np.zeros(n_episodes)
    for _ in range(STEPS):
        observation, reward, *_ = env.step(policy(observation).astype(np.float32))
        total += reward
    env.close()
    return total


def study(arguments: ReferenceScores) -> dict[str, Any]:
    """Scores of all agents as plain data."""
    policies: dict[str, Policy] = {
        "random actions": random_policy(arguments.seed),
        "follow the mission": follow,
        "hand rule": hand_rule,
    }
    seconds = []
    first = arguments.seed
    for number in tqdm(range(first, first + arguments.trainings), unit="training"):
        policies[f"PPO, training {number}"], spent = train(number, arguments.steps)
        seconds.append(spent)
    measured = {name: scores(policy, arguments.episodes) for name, policy in policies.items()}
    followed = measured["follow the mission"]
    return {
        "episodes": arguments.episodes,
        "steps": arguments.steps,
        "training_seconds": seconds,
        "rows": [score_row(name, values, followed) for name, values in measured.items()],
    }


def score_row(agent: str, values: np.ndarray, followed: np.ndarray) -> dict[str, Any]:
    """Mean score of an agent, and what it gains over following the mission, with intervals."""
    return {
        "agent": agent,
        "score": float(values.mean()),
        "score_interval": interval(values, seed=0),
        "gain": float((values - followed).mean()),
        "gain_interval": paired_bootstrap(values, followed, seed=0),
    }


def summary(results: dict[str, Any]) -> list[str]:
    """The best agent, and whether learning gains anything."""
    best = max(results["rows"], key=lambda row: row["score"])
    low, high = best["gain_interval"]
    is_sure = "surely more" if low > 0.0 else "not surely more"
    return [
        f"{len(results['rows'])} agents were scored on the same {results['episodes']} episodes.",
        f"The best, {best['agent']}, reaches {best['score']:.2f}, {is_sure} than following the "
        f"mission: a gain of {best['gain']:+.2f} ({low:+.2f} to {high:+.2f}).",
        "An agent of your own should reach more than the hand rule, which needs no learning.",
    ]


def page(results: dict[str, Any]) -> dict[str, Any]:
    """Title, introduction, command and the table."""
    rows = [
        [
            row["agent"],
            f"{row['score']:.2f}",
            "{:.2f} to {:.2f}".format(*row["score_interval"]),
            f"{row['gain']:+.2f}",
            "{:+.2f} to {:+.2f}".format(*row["gain_interval"]),
        ]
        for row in results["rows"]
    ]
    columns = ["agent", "score", "95 %", "gain over following", "95 %"]
    return {
        "title": "Reference scores of Propulsion-v0",
        "summary": summary(results),
        "intro": [
            "Sum of the rewards of an episode with action='residual' and reward_weights="
            f"{{'deflection': 0.1}}, mean of {results['episodes']} episodes. Intervals are over "
            "these episodes; those of a gain compare episode by episode.",
            f"PPO learnt from {results['steps']} steps in "
            f"{max(results['training_seconds'], default=0.0):.0f} s of processor time at most.",
        ],
        "command": results["command"],
        "sections": [table_section("Scores", columns, rows)],
    }


if __name__ == "__main__":
    command_line(main)
