"""Appendix A of the thesis: the motor's data, their contradiction, and the vehicle's constants."""

import math
from typing import Any, NamedTuple

from auv_fault_env.parameters import OUNCE_INCH, Vehicle, describe
from training.report.sections import table_section
from training.thesis.comparison import AGREES, COLUMNS, DIFFERS


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
    """What constants, resistance, inertia and friction imply for the other entries.

    ``tau_m = J R/(K_T K_b)``, ``K_m = K_T/sqrt(R)``, ``i_stall = V/R``, ``i_0 = tau_c/K_T``, ``L =
    tau_e R``; and the resistance that each of the two contradictory entries would need.
    """
    torque_constant = data.torque_constant * OUNCE_INCH
    inertia = data.armature_inertia * OUNCE_INCH
    coupling = torque_constant * data.back_emf_constant
    time_constant = 1e-3 * data.mechanical_time_constant  # s
    needed_resistance = time_constant * torque_constant * data.back_emf_constant / inertia
    return {
        "mechanical_time_constant": 1e3 * inertia * data.resistance / coupling,  # ms
        "motor_constant": data.torque_constant / math.sqrt(data.resistance),  # oz-in/sqrt(W)
        "stall_current": data.voltage / data.resistance,  # A
        "no_load_current": data.friction_torque / data.torque_constant,  # A
        # V s/rad: equal to K_T in SI by conservation of energy
        "back_emf_constant": torque_constant,
        "inductance": data.electrical_time_constant * data.resistance,  # mH
        "resistance_for_time_constant": needed_resistance,
        "resistance_for_motor_constant": (data.torque_constant / data.motor_constant) ** 2,
    }


WHY = {
    "no_load_current": "Printed to three digits; friction alone gives this.",
    "back_emf_constant": (
        "Printed to two digits. Energy is conserved only with K_b = K_T: the more precise is used."
    ),
}
FORMULAS = {
    "stall_current": "stall current [A], V/R",
    "no_load_current": "no-load current [A], friction/K_T",
    "back_emf_constant": "back-EMF constant [V s/rad], K_T in SI",
    "mechanical_time_constant": "mechanical time constant [ms], J R/(K_T K_b)",
    "motor_constant": "motor constant [oz-in/sqrt(W)], K_T/sqrt(R)",
}


def comparison_rows(data: MotorData) -> list[list[str]]:
    """Printed against derived entries, in the columns of the thesis' comparison."""
    ours = derived(data)
    remedy = "Would need R = {:.2f} ohm."
    why = WHY | {
        "mechanical_time_constant": remedy.format(ours["resistance_for_time_constant"]),
        "motor_constant": remedy.format(ours["resistance_for_motor_constant"]),
    }
    rows = []
    for name, quantity in FORMULAS.items():
        printed = getattr(data, name)
        value = ours[name]
        verdict = AGREES if abs(value / printed - 1) < 0.02 else DIFFERS
        numbers = [f"{printed:g}", f"{value:.4g}", "-"]
        rows.append(["App. A", quantity, *numbers, verdict, why.get(name, "")])
    return rows


def appendix_section() -> dict[str, Any]:
    """Section on the contradiction in Appendix A."""
    data = MotorData()
    text = (
        "Torque constant, back-EMF constant, resistance, inertia and friction imply the other "
        "entries. Stall and no-load current agree; mechanical time constant and motor constant do "
        "not, and each would need another resistance, about twice the printed one, which the stall "
        "current excludes. The plant uses K_T, R, J and the friction. Its inductance would be "
        f"{derived(data)['inductance']:.2f} mH; it is neglected, as in the thesis."
    )
    heading = "Appendix A: the motor's data contradict themselves"
    return table_section(heading, COLUMNS, comparison_rows(data), text)


def constants_section(vehicle: Vehicle) -> dict[str, Any]:
    """Section with every constant of the vehicle and its source."""
    rows = []
    for row in describe(vehicle):
        rows.append(
            [
                row["name"],
                f"{row['value']:.5g}",
                row["unit"],
                row["about"],
                row["source"],
            ]
        )
    text = (
        "T: the thesis. N: NPSNET hydrodynamic file, 1995. H: Healey & Lienard 1993. E: estimate "
        "or default."
    )
    columns = ["name", "value", "unit", "meaning", "source"]
    return table_section("Constants of the vehicle", columns, rows, text)
