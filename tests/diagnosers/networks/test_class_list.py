"""Classes of a training among more classes: the bank's evidence for the others, by hand."""

import numpy as np
import pytest

from auv_fault_env import classes
from auv_fault_env.errors import InputError
from diagnosers import Belief
from diagnosers.networks.class_list import SHIPPED_CLASSES, check_class_list, with_added_classes


def test_the_shipped_classes_are_those_of_the_shipped_catalogue():
    assert classes() == (*SHIPPED_CLASSES, "unknown")


def test_the_bank_weighs_the_added_class_and_the_network_the_others():
    network = Belief(np.log([[0.8, 0.2]]), np.array([[0.0, 0.3]]), np.array([[0.0, 0.1]]))
    bank = Belief(
        np.log([[0.3, 0.6, 0.1]]), np.array([[0.0, 0.7, 0.5]]), np.array([[0.0, 0.2, 0.4]])
    )
    belief = with_added_classes(network, bank, trained=[0, 2])
    np.testing.assert_allclose(np.exp(belief.log_probability), [[0.32, 0.6, 0.08]])
    np.testing.assert_array_equal(belief.severity_mean, [[0.0, 0.7, 0.3]])
    np.testing.assert_array_equal(belief.severity_std, [[0.0, 0.2, 0.1]])


@pytest.mark.parametrize(
    "trained", ["normal", ["drag", "normal"], ["normal", "normal"], ["normal", "rust"], [3]]
)
def test_a_class_list_that_fits_no_catalogue_is_refused(trained):
    with pytest.raises(InputError, match="classes of the weights"):
        check_class_list(trained, ("normal", "drag"))
