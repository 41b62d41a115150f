"""A filter bank light enough to learn a stimulus beside it: one grade of severity, and few sensors' faults."""

import numpy as np

from auv_fault_env.faults import CATALOGUE, NORMAL, classes
from diagnosers import Belief
from diagnosers.bank.kernel import IMPOSSIBLE
from diagnosers.filter_bank import FilterBank

GRADES = ((0.1, 1.0),)
PLANT = tuple(
    fault.name for fault in CATALOGUE.values() if not fault.component.startswith("sensor:")
)
RIVALS = tuple(
    f"sensor_{kind}:{channel}"
    for channel in ("speed", "acceleration")
    for kind in ("bias", "scale")
)
# of the faults to be told: those of the plant
PRIOR = {CATALOGUE[name].diagnosis: 1.0 for name in PLANT}
SUSPECTED = (NORMAL, *dict.fromkeys(CATALOGUE[name].diagnosis for name in (*PLANT, *RIVALS)))
UNSUSPECTED = np.array([name not in SUSPECTED for name in classes()])


def light_bank() -> FilterBank:
    """The bank of hull, propellers, shafts and motors, and of the sensors that are most easily mistaken for them.

    It has a ninth of the whole bank's filters, and its belief moves like `suspected` of the whole
    one's.
    """
    return FilterBank(grades=GRADES, faults=(*PLANT, *RIVALS))


def suspected(belief: Belief) -> Belief:
    """The belief without the classes that the lighter bank does not know, which become impossible."""
    return belief._replace(
        log_probability=np.where(UNSUSPECTED, IMPOSSIBLE, belief.log_probability)
    )
