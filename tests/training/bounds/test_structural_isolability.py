import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import BIAS
from training.bounds.structural_isolability import FAULTS, distinguishability, isolability_tables

SAME_BALANCE = {("friction", "propeller"), ("resistance", "voltage_sensor")}


def test_faults_of_one_balance_are_alike_by_numbers_and_no_others():
    rates = distinguishability()
    for i, fault in enumerate(FAULTS):
        for j, other in enumerate(FAULTS):
            alike = fault == other or {(fault, other), (other, fault)} & SAME_BALANCE
            assert (rates[i, j] < 1e-6) == bool(alike), (fault, other)


def test_a_sensors_fault_cannot_tell_more_than_its_noise_allows():
    k = FAULTS.index("current_sensor")
    most = 0.5 * (BIAS["A"] / CHANNELS["port_current"].noise) ** 2 / 0.1
    assert distinguishability()[k].max() < most


def test_structure_and_numbers_agree_on_every_pair():
    pytest.importorskip("faultdiagnosistoolbox")
    tables = isolability_tables()
    np.testing.assert_array_equal(np.array(tables["isolable"]), np.array(tables["rates"]) > 1e-6)


def test_without_the_toolbox_there_is_no_structure(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert isolability_tables() is None
