"""A Gaussian bank light enough for the training of a stimulus: one grade, and few sensor faults."""

from functools import cache

import numpy as np

from auv_fault_env.faults import CATALOGUE, NORMAL, UNKNOWN, classes
from diagnosers import Belief
from diagnosers.diagnoser import IMPOSSIBLE
from diagnosers.gaussian_bank import GaussianBank

GRADES = ((0.1, 1.0),)
# those that are most easily mistaken for faults of the plant
SENSOR_FAULTS = (
    *("sensor_bias:speed", "sensor_scale:speed"),
    *("sensor_bias:acceleration", "sensor_scale:acceleration"),
)


def plant_faults() -> tuple[str, ...]:
    """The faults of the catalogue but those of sensors."""
    faults = CATALOGUE.values()
    return tuple(fault.name for fault in faults if not fault.component.startswith("sensor:"))


def light_classes() -> tuple[str, ...]:
    """`normal`, the classes of which the light bank has hypotheses, and `unknown`."""
    diagnoses = [CATALOGUE[name].diagnosis for name in (*plant_faults(), *SENSOR_FAULTS)]
    return (NORMAL, *dict.fromkeys(diagnoses), UNKNOWN)


def light_bank() -> GaussianBank:
    """A bank of a ninth of the filters, with a belief like `restrict_belief` of the whole one."""
    return GaussianBank(grades=GRADES, faults=(*plant_faults(), *SENSOR_FAULTS))


@cache
def _is_missing(names: tuple[str, ...]) -> np.ndarray:
    return ~np.isin(names, light_classes())


def restrict_belief(belief: Belief) -> Belief:
    """The belief with the classes that the light bank lacks made impossible."""
    log_probability = np.where(_is_missing(classes()), IMPOSSIBLE, belief.log_probability)
    return belief._replace(log_probability=log_probability)
