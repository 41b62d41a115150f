import numpy as np
import pytest

from auv_fault_env.faults import classes
from diagnosers import Belief, make
from training.benchmark.own_modes import Episodes, OnModes, merged, sample_for, scores_on, tables

CLASSES = classes()


def belief_of(probability, severity=None):
    """A belief of one lane with these probabilities by class, and severities (mean, std)."""
    row = np.array([probability.get(name, 0.0) for name in CLASSES])
    moments = np.zeros((2, 1, len(CLASSES)))
    for name, pair in (severity or {}).items():
        moments[:, 0, CLASSES.index(name)] = pair
    return Belief(np.log(np.maximum(row, 1e-30))[None], *moments)


def probability_of(belief, name):
    return np.exp(belief.log_probability[0, CLASSES.index(name)])


def test_the_classes_of_a_mode_add_up_and_share_what_is_not_normal():
    # two sides of a propeller outweigh drag, though drag is the most probable class
    probability = {"normal": 0.2, "increased_drag": 0.24, "sensor:speed": 0.2}
    probability |= {f"propeller_damage:{side}": 0.18 for side in ("port", "starboard")}
    belief = merged(belief_of(probability), tables()["5.1"])
    assert probability_of(belief, "normal") == pytest.approx(0.2)
    assert probability_of(belief, "increased_drag") == pytest.approx(0.8 * 0.24 / 0.6)
    assert probability_of(belief, "propeller_damage:port") == pytest.approx(0.8 * 0.36 / 0.6)
    assert probability_of(belief, "propeller_damage:starboard") == 0.0
    assert np.exp(belief.log_probability).sum() == pytest.approx(1.0)


def test_the_severity_of_a_mode_by_hand():
    probability = {"normal": 0.2, "propeller_loss:port": 0.6, "propeller_loss:starboard": 0.2}
    severity = {"propeller_loss:port": (0.8, 0.0), "propeller_loss:starboard": (0.4, 0.2)}
    belief = merged(belief_of(probability, severity), tables()["5.2"])
    place = CLASSES.index("propeller_loss:port")
    assert belief.severity_mean[0, place] == pytest.approx(0.7)
    expected = (0.75 * 0.8**2 + 0.25 * (0.4**2 + 0.2**2) - 0.7**2) ** 0.5
    assert belief.severity_std[0, place] == pytest.approx(expected)


def test_a_class_without_a_mode_has_none():
    table = tables()["5.1"]
    assert table.first_of_class[CLASSES.index("decreased_drag")] == -1
    assert tables()["5.2"].first_of_class[CLASSES.index("seal_friction:port")] == -1
    lost = table.first_of_class[CLASSES.index("propeller_loss:starboard")]
    assert CLASSES[lost] == "propeller_damage:port"


def test_the_classes_may_stand_in_another_order():
    class Backwards:
        classes = CLASSES[::-1]

        def reset(self, n_lanes):
            pass

        def update(self, observation):
            probability = {"normal": 0.3, "increased_drag": 0.7}
            return Belief(*(values[:, ::-1] for values in belief_of(probability)))

    belief = OnModes(Backwards(), tables()["5.1"]).update(None)
    assert probability_of(belief, "increased_drag") == pytest.approx(0.7)


@pytest.mark.parametrize(("number", "named"), [("5.1", 4), ("5.2", 5)])
def test_a_sure_diagnoser_names_every_mode_and_only_those(number, named):
    table = tables()[number]
    sample = sample_for(table, Episodes("validation", 0, 28, 0.1, 0.0))
    faults = np.concatenate([half.truth.fault for half in sample.faulty])
    assert set(faults) <= set(table.first) and (faults > 0).all()
    score = scores_on(make("null"), table, sample, seed=0)
    matrix = np.array(score["confusion"])
    assert matrix.shape == (named, named)
    assert matrix[1:, 0].sum() == 28 and matrix[:, 1:].sum() == 0  # `null` never raises an alarm
    assert score["detection"]["probability"] == 0.0
    assert score["in_alarm"] == [0] * (named - 1)


def test_a_fault_may_be_named_without_an_alarm():
    class Hinting:
        """Always names drag, and never doubts that the vehicle is healthy."""

        classes = CLASSES

        def reset(self, n_lanes):
            self.n_lanes = n_lanes

        def update(self, observation):
            belief = belief_of({"normal": 0.9, "increased_drag": 0.1})
            return Belief(*(np.repeat(values, self.n_lanes, axis=0) for values in belief))

    table = tables()["5.1"]
    sample = sample_for(table, Episodes("validation", 0, 28, 0.1, 0.0))
    score = scores_on(Hinting(), table, sample, seed=0)
    faults = np.concatenate([half.truth.fault for half in sample.faulty])
    drag = table.first[1:].tolist().index(CLASSES.index("increased_drag"))
    n_drag = int((faults == CLASSES.index("increased_drag")).sum())
    assert n_drag > 0
    assert score["named"] == [n_drag if mode == drag else 0 for mode in range(len(score["named"]))]
    assert score["in_alarm"] == [0] * len(score["named"])
