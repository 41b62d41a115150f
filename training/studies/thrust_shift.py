"""Whether thrust shifted between the sides shows faults sooner, and at which cost.

Run ``python -m training.studies.thrust_shift``. Rates of evidence at 1 ft/s under excitations of
the speed and of the thrust, and isolation times of `filter_bank` with rules that shift the thrust.
In its results an excitation has its family, the fields of `training.bounds.thrust_shift.Excitation`
and of its `Cost`, added_energy (a share), and rates: by severity, knowledge and fault the fields of
`Rate`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range, whole_number
from training.bounds.thrust_shift import (
    Excitation,
    cost,
    evidence_rates,
    faulty_vehicles,
    offset_of_energy,
)
from training.stimuli import BUDGET
from training.studies.run import command_line, run_study
from training.studies.thrust_shift_loop import closed_loop
from training.studies.thrust_shift_page import page

# of the sides both for one fault, the starboard one to show thrust away from the fault
FAULTS = (
    *("increased_drag", "decreased_drag"),
    *("propeller_damage:port", "propeller_damage:starboard", "propeller_loss:port"),
    *("seal_friction:port", "motor_overheating:port", "sensor_scale:speed"),
)
SEVERITIES = (0.3, 0.6)
# what the likelihoods know of the healthy vehicle
KNOWLEDGE = {"the vehicle": True, "the healthy band": False}
DEPTHS = (0.1, 0.2, 0.4, 0.8)
OFFSETS = (0.02, 0.05, BUDGET)  # m/s
FASTER = "faster"
WAVE = "speed wave"
ALTERNATING = "shift, alternating"
TO_PORT = "shift, to port"
# the shift whose energy a change of speed gets as well
COMPARED_DEPTH = 0.4
SAME_ENERGY = f"energy of a shift of {COMPARED_DEPTH:g}"
LARGEST_SEED = 10_000_000


@dataclass(frozen=True)
class ThrustShift:
    """Measure evidence, costs and isolation times with thrust shifted between the sides."""

    output: Path = Path("runs/thrust_shift")
    """Folder of the report; an earlier run there is replaced."""
    vehicles: int = 4
    """Vehicles for each fault, severity and excitation."""
    lanes: int = 60
    """Vehicles for each fault in the closed loop."""
    seed: int = 0
    """Offset within the seeds of tests, and seed of the bootstrap."""


def main(arguments: ThrustShift) -> None:
    """Measure, and write results and page."""
    whole_number("vehicles", arguments.vehicles)
    whole_number("lanes", arguments.lanes)
    finite_in_range("seed", arguments.seed, 0, LARGEST_SEED)

    def study(_folder: Path) -> dict[str, Any]:
        return {
            "faults": list(FAULTS),
            "severities": list(SEVERITIES),
            "knowledge": list(KNOWLEDGE),
            "vehicles": arguments.vehicles,
            "excitations": excitations(arguments.vehicles, arguments.seed),
            "loop": closed_loop(arguments.lanes, arguments.seed),
        }

    run_study("thrust_shift", arguments, study, page)


def planned_excitations() -> dict[str, tuple[str, Excitation]]:
    """Family and excitation by name; cruise comes first and belongs to none."""
    planned = {"cruise": ("", Excitation())}
    for offset in OFFSETS:
        planned[f"{offset:.2g} m/s faster"] = (FASTER, Excitation(offset))
        planned[f"speed wave of {offset:.2g} m/s"] = (WAVE, Excitation(-offset, alternates=True))
    for depth in DEPTHS:
        alternating = Excitation(shift=depth, alternates=True)
        planned[f"shift of {depth:g}, alternating"] = (ALTERNATING, alternating)
        planned[f"shift of {depth:g} to port"] = (TO_PORT, Excitation(shift=depth))
    energy = cost(Excitation(shift=COMPARED_DEPTH)).energy
    planned[f"faster, {SAME_ENERGY}"] = (FASTER, Excitation(offset_of_energy(energy)))
    return planned


def excitations(vehicles: int, seed: int) -> dict[str, Any]:
    """Cost and rates of every planned excitation by name, as plain data."""
    results = {}
    passive = cost(Excitation()).energy
    for name, (family, excitation) in tqdm(planned_excitations().items(), unit="excitation"):
        paid = cost(excitation)
        results[name] = {
            "family": family,
            **excitation._asdict(),
            **paid._asdict(),
            "added_energy": paid.energy / passive - 1.0,
            "rates": rates_by_severity(excitation, vehicles, seed),
        }
    return results


def rates_by_severity(excitation: Excitation, vehicles: int, seed: int) -> dict[str, Any]:
    """By severity, knowledge and fault the fields of `Rate`."""
    cases = [(fault, severity) for severity in SEVERITIES for fault in FAULTS]
    lanes = faulty_vehicles(excitation, cases, vehicles, seed)
    found = {name: evidence_rates(lanes, cases, knows) for name, knows in KNOWLEDGE.items()}
    return {
        f"{severity:g}": {
            name: {fault: rates[fault, severity]._asdict() for fault in FAULTS}
            for name, rates in found.items()
        }
        for severity in SEVERITIES
    }


if __name__ == "__main__":
    command_line(main)
