"""Faults outside the catalogue, to see what diagnosers say of what they do not know.

No diagnosis class knows them and no sampler draws them; a schedule takes them by name.
"""

from auv_fault_env.errors import known_name
from auv_fault_env.faults import CATALOGUE, UNKNOWN, Fault
from auv_fault_env.parameters import SIDES


class UnmodelledFault(Fault):
    """A fault that no diagnosis class explains."""

    @property
    def diagnosis(self) -> str:
        """The class `unknown`."""
        return UNKNOWN


def _of_the_vehicle() -> list[Fault]:
    blades = {f"{side}_{name}": 1.25 for side in SIDES for name in ("c1", "c2")}
    thrust = {f"{side}_beta": 0.8 for side in SIDES}
    accelerated = {name: 1.0 / 1.3 for name in ("alpha", "gamma", *thrust)}
    return [
        UnmodelledFault(
            "fouled_propellers",
            "propeller",
            scale=thrust | blades,
            about="Weed on both propellers: less thrust, more torque.",
            source="estimate",
        ),
        UnmodelledFault(
            "added_mass",
            "hull",
            scale=accelerated,
            about="The vehicle carries 30 % more mass, water in the hull or a load.",
            source="estimate",
        ),
    ]


def _of_a_side(side: str) -> list[Fault]:
    propeller = {f"{side}_{name}": 0.3 for name in ("beta", "c1", "c2")}
    return [
        UnmodelledFault(
            f"worn_brushes:{side}",
            f"motor:{side}",
            scale={f"{side}_resistance": 1.5},
            about="Brushes and commutator resist more.",
            source="estimate",
        ),
        UnmodelledFault(
            f"weak_magnets:{side}",
            f"motor:{side}",
            scale={f"{side}_torque_constant": 0.8},
            about="The magnets have lost flux, for good.",
            source="estimate",
        ),
        UnmodelledFault(
            f"late_counter:{side}",
            f"sensor:{side}_rpm",
            offset={f"{side}_rpm_latency": 3.0},
            about="The counter of the shaft reports 0.3 s late.",
            source="estimate",
        ),
        UnmodelledFault(
            f"ventilating_propeller:{side}",
            f"propeller:{side}",
            scale=propeller,
            about="The propeller draws air; intermittent, so give the event a period.",
            source="estimate",
        ),
        UnmodelledFault(
            f"current_ripple:{side}",
            f"sensor:{side}_current",
            offset={f"{side}_current_ripple": 0.15},
            about="A sine of 1.3 Hz in the reading of the current.",
            source="estimate",
        ),
        UnmodelledFault(
            f"greater_inertia:{side}",
            f"shaft:{side}",
            scale={f"{side}_inertia": 2.0},
            about="Something turns with the shaft.",
            source="estimate",
        ),
    ]


UNMODELLED: dict[str, Fault] = {
    fault.name: fault for family in (_of_the_vehicle(), *map(_of_a_side, SIDES)) for fault in family
}


def plant_faults() -> dict[str, Fault]:
    """Every fault that a schedule may hold: the catalogue, then the unmodelled ones.

    `EpisodePlan.fault` counts them in this order.
    """
    return CATALOGUE | UNMODELLED


def plant_fault(name: str) -> Fault:
    """The fault of that name; an unknown name is refused with the nearest one and all names."""
    faults = plant_faults()
    return faults[known_name("fault", name, faults)]
