import numpy as np
import pytest

from auv_fault_env.faults import classes
from auv_fault_env.missions import MISSIONS, mission_of
from training.bounds.information import log_likelihoods_unknown_severity
from training.report.figures.registry import draw
from training.studies import isolability
from training.studies.isolability_page import least_rival, page

CLASSES = list(classes())
DRAG = CLASSES.index("increased_drag")
THRUST = CLASSES.index("propeller_damage:port")


@pytest.fixture(scope="module")
def maps():
    found = {}
    for name, mission in {"0.3 m/s": mission_of(0.3), "thesis": MISSIONS["thesis"]}.items():
        lanes = isolability.faulty_lanes(mission, 2, 0)
        found[name] = isolability.evidence_rates(log_likelihoods_unknown_severity(lanes), lanes)
    return found


def test_every_class_is_isolated_from_normal_on_the_thesis_stimulus(maps):
    assert (maps["thesis"][1:, 0] > 0.0).all()
    assert (np.diag(maps["thesis"]) == 0.0).all()


@pytest.mark.parametrize("channel", ["speed", "port_current"])
def test_without_a_sensor_its_evidence_is_gone(channel):
    """Of sensors' faults there is no evidence but their own reading."""
    lanes = isolability.faulty_lanes(mission_of(0.3), 2, 0)
    other = "seal_friction:starboard"
    whole, less = (
        log_likelihoods_unknown_severity(some_lanes)
        for some_lanes in (lanes, isolability.without_sensor(lanes, channel))
    )
    before, after = (
        isolability.evidence_rates(log_likelihoods, lanes) for log_likelihoods in (whole, less)
    )
    kept = CLASSES.index(other)
    assert after[kept, 0] == pytest.approx(before[kept, 0], rel=0.2)
    lost = CLASSES.index("increased_drag" if channel == "speed" else "seal_friction:port")
    assert after[lost, 0] < 0.8 * before[lost, 0]


def test_least_rival_leaves_the_class_itself_out():
    assert least_rival([[0.0, 3.0, 2.0], [0.0, 0.0, 1.0]], 0) == (2, 2.0)
    assert least_rival([[0.0, 3.0, 2.0], [0.5, 0.0, 1.0]], 1) == (0, 0.5)
    assert least_rival([[0.0, 3.0, 2.0]], 0, excluded=2) == (1, 3.0)


def results(structure):
    n = len(CLASSES)
    matrix = (np.ones((n, n)) - np.eye(n)).tolist()
    names = list(isolability.CONDITIONS)
    one = {
        "profile": {"cycles": 2, "duty": 0.5, "roundness": 0.0},
        "active": 2.0,
        "passive_rival": "normal",
    }
    line = {"alpha": [9.0, 3.0], "beta": [9.0, 3.0]}
    return {
        "classes": CLASSES,
        "rates": dict.fromkeys(names, matrix),
        "band_rates": dict.fromkeys(names, matrix),
        "without": {"speed": matrix, "port_rpm": matrix},
        "ceiling": {
            "increased_drag": one | {"passive": 0.0, "speed_up": None},
            "b": one | {"passive": 1.0, "speed_up": 2.0},
        },
        "cramer_rao": {
            "errors": {"bound": line, "surge filter": line},
            "severity": {"thesis": {"a": 0.1}},
        },
        "structure": structure,
        "vehicles": 1,
        "severity": 0.6,
    }


@pytest.mark.parametrize(
    "structure",
    [None, {"faults": ["a", "b"], "isolable": [[False, True]] * 2, "rates": [[0.0, 1.0]] * 2}],
)
def test_the_page_draws_every_figure_from_results_alone(structure):
    sections = page(results(structure))["sections"]
    for section in sections:
        for figure in section.get("figures", ()):
            assert draw(figure["plot"], figure["data"]).axes
        for row in section.get("table", {}).get("rows", ()):
            assert len(row) == len(section["table"]["columns"])
            assert all(isinstance(cell, str) for cell in row)
