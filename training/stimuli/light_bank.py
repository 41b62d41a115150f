"""A filter bank light enough for the training of a stimulus: one grade, and few sensor faults."""

import numpy as np

from auv_fault_env.faults import CATALOGUE, NORMAL, classes
from diagnosers import Belief
from diagnosers.bank.kernel import IMPOSSIBLE
from diagnosers.filter_bank import FilterBank

GRADES = ((0.1, 1.0),)
PLANT_FAULTS = tuple(
    fault.name for fault in CATALOGUE.values() if not fault.component.startswith("sensor:")
)
# those that are most easily mistaken for faults of the plant
SENSOR_FAULTS = tuple(
    f"sensor_{kind}:{channel}"
    for channel in ("speed", "acceleration")
    for kind in ("bias", "scale")
)
FAULTS = (*PLANT_FAULTS, *SENSOR_FAULTS)
PRIOR = {CATALOGUE[name].diagnosis: 1.0 for name in PLANT_FAULTS}
LIGHT_CLASSES = (NORMAL, *dict.fromkeys(CATALOGUE[name].diagnosis for name in FAULTS))
IS_MISSING = np.array([name not in LIGHT_CLASSES for name in classes()])


def light_bank() -> FilterBank:
    """The bank of the faults of hull, propellers, shafts, motors and of two sensors.

    It has a ninth of the filters of the whole bank, and its belief moves like `restrict_belief` of
    the whole one.
    """
    return FilterBank(grades=GRADES, faults=FAULTS)


def restrict_belief(belief: Belief) -> Belief:
    """The belief with the classes that the light bank lacks made impossible."""
    log_probability = np.where(IS_MISSING, IMPOSSIBLE, belief.log_probability)
    return belief._replace(log_probability=log_probability)
