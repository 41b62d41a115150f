"""How fast a stimulus is trained: the fleet against single environments in two processes, the same PPO over both.

Run ``python -m training.studies.training_speed``. Rates are decisions of ten samples per second,
diagnoser and learning included; judge them by their ratio.
"""

import time
from collections.abc import Callable

from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv

from training.active_env import ActiveDiagnosisEnv
from training.learning import stimulus
from training.learning.agent import Agent
from training.learning.stimulus import SETTINGS, StimulusTrainer
from training.stimuli.light_bank import light_bank
from training.studies.run import command_line

PROCESSES = 2
STEPS = 128  # decisions of each single environment between two updates


def one_vehicle() -> ActiveDiagnosisEnv:
    """A single environment with the diagnoser that the training has."""
    return ActiveDiagnosisEnv(diagnoser=light_bank(), cost_weight=0.0)


def seconds(work: Callable[[], object]) -> float:
    """Wall-clock time of a call [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def fleet_rate() -> float:
    """Decisions per second of `StimulusTrainer`, rollouts and updates; without the first epoch, which compiles."""
    trainer = StimulusTrainer(0)
    trainer.epoch(0)
    return trainer.decisions / seconds(lambda: trainer.epoch(1))


def single_rate() -> float:
    """Decisions per second of the same PPO over single environments in processes."""
    env = SubprocVecEnv([one_vehicle] * PROCESSES)
    try:
        model = PPO(Agent, env, stimulus.RATE, n_steps=STEPS, device="cpu", **SETTINGS)
        model.learn(STEPS * PROCESSES)
        return 2 * STEPS * PROCESSES / seconds(lambda: model.learn(2 * STEPS * PROCESSES))
    finally:
        env.close()


def main() -> None:
    """Measure one after the other and print the ratio."""
    single = single_rate()
    fleet = fleet_rate()
    print(f"single environments in {PROCESSES} processes: {single:,.0f} decisions per second")
    print(
        f"fleet of {stimulus.LANES}: {fleet:,.0f} decisions per second, {fleet / single:.1f} times as many"
    )


if __name__ == "__main__":
    command_line(main)
