"""Faults on any Gymnasium environment, as wrappers."""

from auv_fault_env.wrappers.signal_faults import SignalFault
from auv_fault_env.wrappers.single import FaultInjection
from auv_fault_env.wrappers.vector import FaultInjectionVector

__all__ = ["FaultInjection", "FaultInjectionVector", "SignalFault"]
