"""The thesis' map from drag and thrust to operating mode and severity (V.B, Fig. 5.1, Table 5.2).

Plane and windows of normal operation are the thesis'. Its picture is lost, so this project decides:

* The grade is the severity at which the fault of the catalogue moves the parameter to that point:
  +35 % of drag has 0.35, twice or half the drag 1, a whole propeller lost 1. It stays 1 beyond.
* Severe propulsion failure begins at 0.5, a little above the 0.45 of one propeller lost, so that
  the scatter of a filter does not move a lost propeller out of it.
* Where both parameters are out of their windows, the mode with the larger grade applies; alpha's if
  they are equal. Beta above its window is normal: Table 5.2 has no mode for too much thrust.
"""

import numpy as np

from auv_fault_env.errors import whole_number
from auv_fault_env.faults import fault_of

MODES_5_1 = (
    "normal",
    "increased seal friction",
    "increased drag",
    "degraded propeller",
)
MODES_5_2 = (
    *("normal", "increased drag", "decreased drag"),
    *("decreased propulsion", "severe propulsion failure"),
)

NOMINAL = (0.5, 0.9)  # of (alpha, beta), thesis V.B
ALPHA_WINDOW = (0.4, 0.6)  # thesis V.B: 20 % either way
BETA_WINDOW = (0.65, 1.0)  # thesis V.B: 25 % less, as it says; 28 % by its numbers
SEVERE = 0.5  # beta below which propulsion has failed
# of the modes in `severity`: from exact outputs they return the grade
SEVERITY_WEIGHTS = (0.0, 1.0, 1.0, 1.0, 1.0)


def normalise(alpha_relative: np.ndarray, beta_relative: np.ndarray) -> np.ndarray:
    """The points of the map, (n, 2) clipped to [0, 1], from alpha and beta relative to nominal."""
    points = np.stack([alpha_relative, beta_relative], axis=-1) * NOMINAL
    return np.clip(points, 0.0, 1.0)


def grades(points: np.ndarray) -> np.ndarray:
    """The grade of each mode, (n, 5), at the points (n, 2); 0 in the window of its parameter."""
    alpha, beta = np.asarray(points, np.float64).T
    more_drag = _severity(alpha / NOMINAL[0], fault_of("increased_drag").scale["alpha"])
    less_drag = _severity(alpha / NOMINAL[0], fault_of("decreased_drag").scale["alpha"])
    one_lost = 0.5 * (1.0 + fault_of("propeller_loss:port").scale["port_beta"])
    less_thrust = _severity(beta / NOMINAL[1], one_lost)
    is_severe = beta < SEVERE
    is_decreased = (beta < BETA_WINDOW[0]) & ~is_severe
    grade = np.zeros((len(alpha), len(MODES_5_2)))
    grade[:, 1] = np.where(alpha > ALPHA_WINDOW[1], more_drag, 0.0)
    grade[:, 2] = np.where(alpha < ALPHA_WINDOW[0], less_drag, 0.0)
    grade[:, 3] = np.where(is_decreased, less_thrust, 0.0)
    grade[:, 4] = np.where(is_severe, less_thrust, 0.0)
    return grade


def _severity(relative: np.ndarray, scale: float) -> np.ndarray:
    """Severity of a fault with this scale at severity 1 that leaves this share of a parameter."""
    return np.clip((relative - 1.0) / (scale - 1.0), 0.0, 1.0)


def fault_map(points: np.ndarray) -> np.ndarray:
    """The target of the network, (n, 5), at the points (n, 2): vector of Table 5.2 times grade.

    Within both windows that is (1, 0, 0, 0, 0).

    >>> fault_map(normalise(np.array([1.0, 1.35, 1.0]), np.array([1.0, 1.0, 0.5]))).round(2)
    array([[1.  , 0.  , 0.  , 0.  , 0.  ],
           [0.  , 0.35, 0.  , 0.  , 0.  ],
           [0.  , 0.  , 0.  , 0.  , 1.  ]])
    """
    grade = grades(points)
    mode = grade.argmax(axis=1)
    vectors = np.eye(len(MODES_5_2))[mode]
    return np.where(mode[:, None] == 0, vectors, vectors * grade)


def severity(outputs: np.ndarray) -> np.ndarray:
    """Height of the decision surface of Fig. 5.12, (n,): the weighted sum of the outputs (n, 5).

    The thesis does not give its weights; with `SEVERITY_WEIGHTS` the height is 0 where all is
    normal and 1 where a propeller is lost. Misleads between two modes, whose parts add up.
    """
    return np.asarray(outputs) @ np.array(SEVERITY_WEIGHTS)


def grid(n: int) -> np.ndarray:
    """The points (n * n, 2) of an even grid over the map, alpha slowest: the thesis' training."""
    axis = np.linspace(0.0, 1.0, whole_number("points along an axis of the grid", n, 2))
    alpha_and_beta = np.meshgrid(axis, axis, indexing="ij")
    return np.stack(alpha_and_beta, axis=-1).reshape(-1, 2)
