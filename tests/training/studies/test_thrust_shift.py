import json

import pytest

from training.studies import thrust_shift, thrust_shift_loop
from training.studies.thrust_shift import ThrustShift, planned_excitations
from training.studies.thrust_shift_loop import RULES


def test_the_study_writes_rates_costs_and_the_loop(tmp_path, monkeypatch):
    planned = planned_excitations()
    names = (
        *("cruise", "shift of 0.4, alternating", "shift of 0.4 to port"),
        "faster, energy of a shift of 0.4",
    )
    monkeypatch.setattr(
        thrust_shift, "planned_excitations", lambda: {name: planned[name] for name in names}
    )
    rules = {name: RULES[name] for name in ("cruise", "triggered_shift", "shift_wave")}
    monkeypatch.setattr(thrust_shift_loop, "RULES", rules)
    monkeypatch.setattr(thrust_shift, "SEVERITIES", (0.6,))
    thrust_shift.main(ThrustShift(output=tmp_path / "out", vehicles=1, lanes=1))
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    assert list(results["excitations"]) == list(names)
    cruise, _, shifted, _ = (results["excitations"][name] for name in names)
    assert cruise["added_energy"] == 0.0 < shifted["added_energy"] < 0.05
    toward = shifted["rates"]["0.6"]["the vehicle"]["propeller_damage:port"]["against_normal"]
    plain = cruise["rates"]["0.6"]["the vehicle"]["propeller_damage:port"]["against_normal"]
    assert toward > 1.5 * plain > 0.0
    stimuli = results["loop"]["stimuli"]
    assert stimuli["cruise"]["healthy_energy"] == 0.0 < stimuli["shift_wave"]["healthy_energy"]
    assert stimuli["cruise"]["difference"] == [0.0, 0.0, 0.0]
    assert 0.1 <= stimuli["shift_wave"]["by_fault"]["propeller_damage:port"] <= 30.0
    assert (tmp_path / "out" / "figures" / "evidence-energy.png").is_file()
    page = (tmp_path / "out" / "index.html").read_text()
    assert "the healthy band known" in page and "suspected if healthy" in page


def test_the_faster_vehicle_has_the_energy_of_the_shift():
    planned = planned_excitations()
    _, faster = planned["faster, energy of a shift of 0.4"]
    _, shifted = planned["shift of 0.4 to port"]
    energies = [thrust_shift.cost(excitation).energy for excitation in (faster, shifted)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-4)
