"""An environment whose values are known: a counter, random numbers of its own, a falling line."""

import gymnasium as gym
import numpy as np

from auv_fault_env.wrappers import SignalFault

COUNT, RANDOM, FALL = range(3)
FAULTS = {
    "bias": SignalFault("bias", "observation", FALL, 2.0),
    "scale": SignalFault("scale", "observation", COUNT, 0.5),
    "noise": SignalFault("noise", "observation", RANDOM, 0.3),
    "stuck": SignalFault("stuck", "observation", COUNT, 1.0),
    "dropout": SignalFault("dropout", "observation", COUNT, 1.0),
    "delay": SignalFault("delay", "observation", COUNT, 4.0),
    "gain": SignalFault("gain", "action", 0, 0.25),
    "offset": SignalFault("offset", "action", 1, 0.5),
    "stuck_action": SignalFault("stuck", "action", 0, 1.0),
    "late_action": SignalFault("delay", "action", 1, 3.0),
}
OF_OBSERVATION = [name for name, fault in FAULTS.items() if fault.target == "observation"]
OF_ACTION = [name for name, fault in FAULTS.items() if fault.target == "action"]


class Counting(gym.Env):
    """Episodes of `length` steps; the observation is its state too, so that nobody may write it."""

    def __init__(self, length=1000):
        low = np.array([-1.0, -5.0, -1e3], np.float32)
        high = np.array([1e3, 5.0, 1e3], np.float32)
        self.observation_space = gym.spaces.Box(low, high)
        self.action_space = gym.spaces.Box(-2.0, 2.0, (2,), np.float32)
        self.length = length
        self.received = []

    def _observe(self):
        self.state = np.array(
            [self.count, self.np_random.uniform(-1.0, 1.0), -0.5 * self.count - 0.25], np.float32
        )
        return self.state

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.options = options
        self.count = 1
        return self._observe(), {"count": np.int64(1)}

    def step(self, action):
        self.received.append(np.array(action))
        self.count += 1
        reward = float(np.sum(action))
        is_over = self.count > self.length
        return self._observe(), reward, is_over, False, {"count": np.int64(self.count)}


def event(fault, onset=5, severity=1.0, **others):
    return {"fault": fault, "onset": onset, "severity": severity, **others}


def actions(steps, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, 2)).astype(np.float32)


def episode(env, steps=20, seed=3, options=None):
    """Observations (steps + 1, 3) and information of an episode, the reset first."""
    observation, info = env.reset(seed=seed, options=options)
    observations = [observation.copy()]
    infos = [info]
    for action in actions(steps):
        observation, _, _, _, info = env.step(action)
        observations.append(observation.copy())
        infos.append(info)
    return np.array(observations), infos
