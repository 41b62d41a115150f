import pkgutil

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from diagnosers import NAMES
from training.learning.trainer import TRAINERS, make_trainer


@pytest.mark.parametrize("name", TRAINERS)
def test_state_of_every_trainer_is_all_that_the_next_epoch_needs_to_begin(name):
    one = make_trainer(name, 0)
    other = make_trainer(name, 1)
    before = {key: np.array(tensor) for key, tensor in one.state().items()}
    assert any(not np.array_equal(tensor, other.state()[key]) for key, tensor in before.items())
    other.restore(before)
    after = other.state()
    assert after.keys() == before.keys()
    for key, tensor in before.items():
        np.testing.assert_array_equal(after[key], tensor, strict=True)


@pytest.mark.parametrize("name", TRAINERS)
def test_every_trainer_says_how_long_and_on_what(name):
    kind = pkgutil.resolve_name(TRAINERS[name])
    assert 1 <= kind.patience <= kind.epochs
    assert len(kind.data) > 40
    assert name in NAMES


@pytest.mark.parametrize("name", ["limits", "integratd", ""])
def test_what_does_not_learn_is_refused(name):
    with pytest.raises(
        InputError, match="diagnoser to train: got .* allowed is one of " + ", ".join(TRAINERS)
    ):
        make_trainer(name, 0)
