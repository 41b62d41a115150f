import pytest

from training.thesis.appendix_a import MotorData, comparison_rows, derived


def test_derived_entries_are_those_worked_out_by_hand():
    ours = derived(MotorData())
    assert ours["stall_current"] == pytest.approx(24.0 / 1.01)
    assert ours["no_load_current"] == pytest.approx(1.79 / 8.67)
    assert ours["back_emf_constant"] == pytest.approx(8.67 * 0.00706155, rel=1e-5)
    assert ours["mechanical_time_constant"] == pytest.approx(4.39, abs=0.01)  # ms, printed as 8.5
    # oz-in/sqrt(W), printed as 5.81
    assert ours["motor_constant"] == pytest.approx(8.627, abs=0.001)


def test_the_resistances_it_names_would_indeed_give_the_printed_entries():
    data = MotorData()
    ours = derived(MotorData())
    for name in ("time_constant", "motor_constant"):
        entry = {"time_constant": "mechanical_time_constant", "motor_constant": "motor_constant"}[
            name
        ]
        other = derived(data._replace(resistance=ours[f"resistance_for_{name}"]))
        assert other[entry] == pytest.approx(getattr(data, entry))
        assert not other["stall_current"] == pytest.approx(data.stall_current, rel=0.2)


def test_exactly_two_entries_differ():
    verdicts = {row[1].split(" [")[0]: row[5] for row in comparison_rows(MotorData())}
    assert [name for name, verdict in verdicts.items() if verdict == "differs"] == [
        "mechanical time constant",
        "motor constant",
    ]
