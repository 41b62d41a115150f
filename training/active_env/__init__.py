"""The active environment: every second an agent chooses the speed, to identify a fault sooner.

Importing this package registers ``auv_fault_env/ActiveDiagnosis-v0``. Gymnasium imports it by the
name ``training.active_env:auv_fault_env/ActiveDiagnosis-v0``, for `gym.make` and `gym.make_vec`.
"""

import gymnasium as gym

from training.active_env.rewards import Decision, delay_penalty, log_probability_gain
from training.active_env.single import ActiveDiagnosisEnv
from training.active_env.vector import MAX_DECISIONS, ActiveDiagnosisVectorEnv
from training.stimuli.policy_inputs import FEATURES

__all__ = [
    "FEATURES",
    "NAME",
    "ActiveDiagnosisEnv",
    "ActiveDiagnosisVectorEnv",
    "Decision",
    "delay_penalty",
    "log_probability_gain",
]
NAME = "auv_fault_env/ActiveDiagnosis-v0"

gym.register(
    id=NAME,
    entry_point="training.active_env:ActiveDiagnosisEnv",
    vector_entry_point="training.active_env:ActiveDiagnosisVectorEnv",
    max_episode_steps=MAX_DECISIONS,
)
