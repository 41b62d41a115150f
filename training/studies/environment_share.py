"""How much of the processor time of a training the environment takes, as a fleet and one by one.

Run ``python -m training.studies.environment_share``. PPO of stable-baselines3 with its default
settings learns on `Propulsion-v0`, on one thread; judge the shares beside each other.
"""

import time

import gymnasium as gym
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

import auv_fault_env  # noqa: F401 - registers the environment
from training.sb3 import FleetVecEnv
from training.studies.run import command_line

NAME = "auv_fault_env/Propulsion-v0"
SETTINGS = {"action": "residual"}
LANES = 64
STEPS = 64  # of each lane between two updates
ROLLOUTS = 2


class Timed(VecEnvWrapper):
    """Counts the processor time of resets and steps."""

    seconds = 0.0

    def reset(self) -> VecEnvObs:
        """The environment's reset."""
        start = time.process_time()
        observation = self.venv.reset()
        self.seconds += time.process_time() - start
        return observation

    def step_wait(self) -> VecEnvStepReturn:
        """The environment's step."""
        start = time.process_time()
        result = self.venv.step_wait()
        self.seconds += time.process_time() - start
        return result


def share(env: VecEnv) -> float:
    """The share of the environment in the processor time of a training, after one to warm up."""
    timed = Timed(env)
    model = PPO("MlpPolicy", timed, n_steps=STEPS, device="cpu", seed=0)
    model.learn(LANES * STEPS)
    timed.seconds = 0.0
    start = time.process_time()
    model.learn(ROLLOUTS * LANES * STEPS)
    return timed.seconds / (time.process_time() - start)


def fleet() -> FleetVecEnv:
    """One environment of all lanes."""
    form = "vector_entry_point"
    return FleetVecEnv(gym.make_vec(NAME, LANES, form, autoreset_mode="SameStep", **SETTINGS))


def one_by_one() -> DummyVecEnv:
    """One environment for each lane."""
    return DummyVecEnv([lambda: gym.make(NAME, **SETTINGS)] * LANES)


def main() -> None:
    """Measure both and print the shares."""
    torch.set_num_threads(1)
    print(f"{LANES} vehicles in DummyVecEnv: {100.0 * share(one_by_one()):.1f} % of the training")
    print(f"{LANES} vehicles in FleetVecEnv: {100.0 * share(fleet()):.1f} % of the training")


if __name__ == "__main__":
    command_line(main)
