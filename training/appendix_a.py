"""Appendix A of the thesis, the motor's data sheet, and the contradiction in it."""

import math
from typing import NamedTuple

from auv_fault_env.parameters import OUNCE_INCH


class MotorData(NamedTuple):
    """Pittman 14202 as Appendix A prints it, in its units."""

    electrical_time_constant: float = 1.47  # ms
    mechanical_time_constant: float = 8.5  # ms
    friction_torque: float = 1.79  # oz-in
    armature_inertia: float = 2.3e-3  # oz-in-s^2
    motor_constant: float = 5.81  # oz-in/sqrt(W)
    voltage: float = 24.0  # V
    torque_constant: float = 8.67  # oz-in/A
    resistance: float = 1.01  # ohm
    back_emf_constant: float = 0.061  # V s/rad
    no_load_current: float = 0.210  # A
    stall_current: float = 23.8  # A


def derived(data: MotorData) -> dict[str, float]:
    """What torque constant, back-EMF constant, resistance, inertia and friction imply for the other entries.

    ``tau_m = J R/(K_T K_b)``, ``K_m = K_T/sqrt(R)``, ``i_stall = V/R``, ``i_0 = tau_c/K_T``, ``L = tau_e R``; and the
    resistance that each of the two contradictory entries would need.
    """
    flux, inertia = data.torque_constant * OUNCE_INCH, data.armature_inertia * OUNCE_INCH
    return {
        "mechanical_time_constant": 1e3 * inertia * data.resistance / (flux * data.back_emf_constant),  # ms
        "motor_constant": data.torque_constant / math.sqrt(data.resistance),  # oz-in/sqrt(W)
        "stall_current": data.voltage / data.resistance,  # A
        "no_load_current": data.friction_torque / data.torque_constant,  # A
        "back_emf_constant": flux,  # V s/rad: equal to K_T in SI by conservation of energy
        "inductance": data.electrical_time_constant * data.resistance,  # mH
        "resistance_for_time_constant": 1e-3 * data.mechanical_time_constant * flux * data.back_emf_constant / inertia,
        "resistance_for_motor_constant": (data.torque_constant / data.motor_constant) ** 2,
    }
