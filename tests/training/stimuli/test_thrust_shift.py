import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import classes
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief, make
from training.benchmark.suites import IDEAL, Episode, load
from training.benchmark.trials import run_closed_loop
from training.stimuli import STIMULI
from training.stimuli.base import with_shift
from training.stimuli.thrust_shift import DEPTH, shift_to_suspect, side_of_class
from training.studies.thrust_shift_loop import ShiftWave

OBSERVATION = np.zeros((1, len(CHANNELS)))


def log_probability(**shares):
    """Of one lane, the rest normal; names with `__` for `:`."""
    values = np.full(len(classes()), 1e-12)
    for name, share in shares.items():
        values[classes().index(name.replace("__", ":"))] = share
    values[0] = 1.0 - sum(shares.values())
    return np.log(values)[None]


def test_the_sides_of_classes():
    sides = dict(zip(classes(), side_of_class(classes()), strict=True))
    assert sides["seal_friction:port"] == 1.0 == sides["propeller_loss:port"]
    assert sides["motor_overheating:starboard"] == -1.0
    # the sensors of a shaft do not fail more by its thrust
    assert sides["sensor:port_rpm"] == 0.0 == sides["normal"] == sides["increased_drag"]


@pytest.mark.parametrize(
    ("shares", "shift"),
    [
        ({}, 0.0),
        ({"increased_drag": 0.9}, 0.0),
        ({"propeller_damage__port": 0.2}, DEPTH * 0.25),
        ({"propeller_damage__starboard": 0.2}, -DEPTH * 0.25),
        ({"propeller_damage__port": 0.2, "seal_friction__starboard": 0.2}, 0.0),
        ({"propeller_damage__port": 0.7}, DEPTH),
        ({"propeller_damage__port": 0.97}, 0.0),
        ({"propeller_damage__port": 0.5, "propeller_loss__port": 0.48}, DEPTH),
    ],
)
def test_the_rule_by_hand(shares, shift):
    assert shift_to_suspect(log_probability(**shares)) == pytest.approx([shift], abs=1e-9)


def test_the_wave_spends_as_long_on_either_side():
    wave = ShiftWave()
    shifts = np.array([wave.thrust_shift(k, OBSERVATION, None)[0] for k in range(400)])
    assert set(shifts) == {-DEPTH, DEPTH}
    assert shifts.sum() == 0.0 == shifts[:200].sum()


def test_commands_have_a_fourth_column_only_with_a_shift():
    commands = np.ones((2, 3))
    assert with_shift(commands, None) is commands
    assert with_shift(commands, np.array([0.1, 0.2])).tolist() == [[1, 1, 1, 0.1], [1, 1, 1, 0.2]]


def test_other_stimuli_have_none_and_this_stays_in_speed():
    normal = Belief(log_probability(), np.zeros((1, len(classes()))), np.zeros((1, len(classes()))))
    assert STIMULI["triggered_surge"]().thrust_shift(0, OBSERVATION, normal) is None
    assert STIMULI["triggered_shift"]().offset(0, OBSERVATION, normal).tolist() == [0.0]


def test_the_loop_applies_the_shift():
    fault = FaultEvent("propeller_damage:port", 1.0, 1.0)
    episodes = [Episode(2_900_000_000, (fault,), load(IDEAL).conditions.sample_missions([3])[0])]
    readings = {}
    for name, stimulus in {"cruise": STIMULI["cruise"](), "shift_wave": ShiftWave()}.items():
        loop = run_closed_loop(make("null"), stimulus, load(IDEAL).conditions, episodes)
        rows = [sample.observation[0] for _, sample in zip(range(150), loop, strict=False)]
        port, starboard = np.array(rows)[:, [INDEX["port_rpm"], INDEX["starboard_rpm"]]].T
        readings[name] = port / starboard
    assert readings["cruise"][90:] == pytest.approx(1.0, abs=0.05)
    # first to starboard, then to port
    expected = np.sqrt((1.0 - DEPTH) / (1.0 + DEPTH))
    assert readings["shift_wave"][90:100] == pytest.approx(expected, abs=0.05)
    assert readings["shift_wave"][140:150] == pytest.approx(1.0 / expected, abs=0.1)
