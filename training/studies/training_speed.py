"""How fast a stimulus is trained on the fleet, beside the same PPO on single environments.

Run ``python -m training.studies.training_speed``. Rates are decisions of ten samples per second,
diagnoser and learning included; judge them by their ratio.
"""

import time
from collections.abc import Callable

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv

from training.active_env import ActiveDiagnosisEnv
from training.learning import stimulus
from training.learning.agent import Agent
from training.learning.stimulus import SETTINGS, StimulusTrainer
from training.stimuli.light_bank import light_bank
from training.studies.run import command_line

PROCESSES = 2
# decisions of each single environment between two updates
STEPS = 128
ENVIRONMENT_DECISIONS = 30  # of every vehicle


def single_environment() -> ActiveDiagnosisEnv:
    """A single environment with the diagnoser of the training."""
    return ActiveDiagnosisEnv(diagnoser=light_bank(), cost_weight=0.0)


def seconds_of(work: Callable[[], object]) -> float:
    """Wall-clock time of a call [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def fleet_rate() -> float:
    """Decisions per second of `StimulusTrainer` in its second epoch; the first one compiles."""
    trainer = StimulusTrainer(0)
    trainer.epoch(0)
    return trainer.decisions / seconds_of(lambda: trainer.epoch(1))


def environment_rate() -> float:
    """Decisions per second of the environment of the training alone, without any learning."""
    env = StimulusTrainer(0).env
    still = np.zeros((env.num_envs, 1), np.float32)
    env.reset()
    env.step(still)
    seconds = seconds_of(lambda: [env.step(still) for _ in range(ENVIRONMENT_DECISIONS)])
    return ENVIRONMENT_DECISIONS * env.num_envs / seconds


def single_rate() -> float:
    """Decisions per second of the same PPO on single environments in processes."""
    env = SubprocVecEnv([single_environment] * PROCESSES)
    decisions = 2 * STEPS * PROCESSES
    try:
        network = {"n_truth": 0}
        model = PPO(
            Agent,
            env,
            stimulus.RATE,
            n_steps=STEPS,
            policy_kwargs=network,
            device="cpu",
            **SETTINGS,
        )
        model.learn(STEPS * PROCESSES)
        return decisions / seconds_of(lambda: model.learn(decisions))
    finally:
        env.close()


def main() -> None:
    """Measure one after the other and print the ratio."""
    single = single_rate()
    fleet = fleet_rate()
    ratio = fleet / single
    print(f"single environments in {PROCESSES} processes: {single:,.0f} decisions per second")
    rate = f"{fleet:,.0f} decisions per second, {ratio:.1f} times as many"
    print(f"fleet of {stimulus.LANES}: {rate}")
    print(f"its environment alone: {environment_rate():,.0f} decisions per second")


if __name__ == "__main__":
    command_line(main)
