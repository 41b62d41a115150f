import json

import numpy as np
import pytest

from training.studies import fault_injection
from training.studies.fault_injection import FaultInjectionStudy


def test_tables_have_every_fault_and_every_environment(tmp_path, monkeypatch):
    monkeypatch.setattr(fault_injection, "STEPS", 16)
    monkeypatch.setattr(
        fault_injection,
        "rates_in_turn",
        lambda runs, *_: {name: [run() for run in (run, run)] for name, run in runs.items()},
    )
    output = tmp_path / "out"
    fault_injection.main(FaultInjectionStudy(output=output, episodes=12, repeats=1))
    results = json.loads((output / "results.json").read_text())
    assert set(results["detected"]) == {"healthy", *fault_injection.FAULTS}
    detected = results["detected"]
    assert detected["bias of the rate, 0.5 rad/s"]["1"]["share"] == 1.0
    # the torque changes the motion, not the relation between angle and rate
    assert detected["half of the torque"]["1"]["share"] < 0.5
    assert set(results["ratios"]) == set(fault_injection.TIMED)
    assert {ratio for row in results["ratios"].values() for ratio in row.values()} == {1.0}


def test_the_residual_is_zero_without_noise_and_shows_a_bias_alone(monkeypatch):
    monkeypatch.setattr(fault_injection, "NOISES", {})
    event = {"fault": "bias of the rate, 0.5 rad/s", "onset": 5.0, "severity": 0.6}
    values = fault_injection.indicator([event], range(5))
    share = 0.3 / fault_injection.WINDOW  # of a window that ends with the first faulty sample
    assert values[0] == pytest.approx(share, abs=1e-4)
    # two of them turn at the greatest rate, where the saturated reading hides a part of the bias
    assert values.max() == pytest.approx(0.3, abs=1e-4)
    assert np.median(values[fault_injection.WINDOW - 1]) == pytest.approx(0.3, abs=1e-4)
    assert fault_injection.indicator([], range(4)).max() < 1e-4


def test_alarms_and_delays_by_hand():
    indicators = np.array([[0.0, 2.0], [0.0, 0.0], [0.0, 3.0], [0.5, 0.0]])
    expected = {"share": 1.0, "delay": pytest.approx(0.075)}
    assert fault_injection.alarms(indicators, 0.4) == expected
    assert fault_injection.alarms(indicators, 4.0) == {"share": 0.0, "delay": None}
