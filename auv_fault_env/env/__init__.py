"""The Gymnasium environment of the vehicle under way, single and for many vehicles at once."""

from auv_fault_env.env.single import PropulsionEnv
from auv_fault_env.env.vector import PropulsionVectorEnv

__all__ = ["PropulsionEnv", "PropulsionVectorEnv"]
