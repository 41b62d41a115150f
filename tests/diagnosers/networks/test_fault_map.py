import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.faults import labels
from diagnosers.networks.fault_map import MODES_5_1, MODES_5_2, fault_map, grid, normalise, severity


@pytest.mark.parametrize(
    ("alpha", "beta", "mode", "grade"),
    [
        (1.00, 1.00, "normal", 1.0),
        # thesis V.B: windows of 0.4 to 0.6 around 0.5 and of 0.65 to 1.0 around 0.9
        (1.19, 0.73, "normal", 1.0),
        (0.81, 1.11, "normal", 1.0),
        (1.00, 1.30, "normal", 1.0),  # beyond the window, but Table 5.2 has no mode for it
        (1.35, 1.00, "increased drag", 0.35),  # thesis V.D, Fig. 5.16
        (2.50, 1.00, "increased drag", 1.0),
        (0.75, 1.00, "decreased drag", 0.5),
        (0.30, 1.00, "decreased drag", 1.0),
        (1.00, 0.65, "decreased propulsion", 0.7),  # thesis IV.C: -35 %
        (1.00, 0.50, "severe propulsion failure", 1.0),  # thesis V.D: one propeller lost
        (1.00, 0.00, "severe propulsion failure", 1.0),
        (1.35, 0.50, "severe propulsion failure", 1.0),  # corners: the larger grade
        (1.90, 0.65, "increased drag", 0.9),
    ],
)
def test_values_of_the_map_by_hand(alpha, beta, mode, grade):
    expected = grade * np.eye(5)[MODES_5_2.index(mode)]
    np.testing.assert_allclose(
        fault_map(normalise(np.array([alpha]), np.array([beta])))[0], expected, atol=1e-12
    )


@pytest.mark.parametrize(("table", "modes"), [(0, MODES_5_1), (1, MODES_5_2)])
def test_the_catalogue_speaks_of_the_same_modes(table, modes):
    assert {pair[table] for pair in labels().values()} - {None} == set(modes)


def test_severity_gives_the_grade_back_and_nothing_where_all_is_normal():
    points = normalise(np.array([1.0, 1.35, 1.0]), np.array([1.0, 1.0, 0.5]))
    np.testing.assert_allclose(severity(fault_map(points)), [0.0, 0.35, 1.0], atol=1e-12)


def test_severity_grows_with_the_distance_from_the_window():
    heights = severity(fault_map(normalise(np.linspace(1.0, 2.0, 50), np.ones(50))))
    assert (np.diff(heights) >= 0).all() and heights[0] == 0.0 and heights[-1] == 1.0


def test_the_grid_covers_the_square_and_every_mode():
    points = grid(21)
    assert points.shape == (441, 2) and points.min() == 0.0 and points.max() == 1.0
    assert set(fault_map(points).argmax(axis=1)) == set(range(5))


def test_a_grid_of_one_point_is_refused():
    with pytest.raises(InputError, match="whole number from 2"):
        grid(1)
