"""The integration of one lane, from a motion to a motion."""

import numpy as np

from auv_fault_env import integration, layout
from auv_fault_env.integration import Motion


def lane_between_samples(motion, drag, disturbance, port, starboard):
    """The scratch rows of one lane in which `integration.advance_motions` writes."""
    scratch = np.zeros((layout.N_INTEGRATION, layout.LANES))
    values = (*motion, *port, *starboard, drag, disturbance)
    scratch[: layout.MOTION, 0] = values
    return scratch


def advance(motion, drag, disturbance, port, starboard):
    """The `Motion` one sample later, under a constant disturbance [m/s^2] and two `Motor` s."""
    scratch = lane_between_samples(motion, drag, disturbance, port, starboard)
    integration.advance_motions(scratch.ravel(), 1)
    return Motion(*scratch[layout.MOTION : layout.MISFIT, 0].tolist())
