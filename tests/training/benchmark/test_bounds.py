import json

import numpy as np
import pytest

from auv_fault_env.faults import classes
from auv_fault_env.parameters import SAMPLE_TIME
from diagnosers import make
from training import metrics
from training.benchmark.bounds import AMOC_RATES, FEWEST, RATES, bounds_of, check
from training.bounds.delays import bootstrap, delay_bound, detection_power
from training.bounds.information import log_likelihoods_known_severity, simulate_suite_lanes
from training.metrics.records import HORIZON
from training.stimuli import Thesis

N_LANES = 36
MEAN_TIME = 600.0
PERSISTENCE = 3


@pytest.fixture(scope="module")
def found():
    return bounds_of(Thesis(), seed=0, n_lanes=N_LANES)


def test_bounds_are_plain_data_for_every_class(found):
    json.dumps(found, allow_nan=False)
    assert list(found["classes"]) == list(classes()[1:-1])


def test_rarer_false_alarms_take_longer(found):
    for one in found["classes"].values():
        assert one["detection_delay"]["1 h"][0] <= one["detection_delay"]["10 h"][0] <= HORIZON
        assert (np.diff(one["delay_by_rate"]) <= 0.0).all() and len(one["delay_by_rate"]) == len(
            AMOC_RATES
        )
        assert one["rival"] in found["classes"]
        low, high = one["detection_delay"]["1 h"][1:]
        assert low <= high
    assert (
        found["all"]["isolation_delay"]["1 h"][0]
        >= found["all"]["detection_delay"]["1 h"][0] - 1e-9
    )


def test_ratios_are_nearly_likelihood_ratios(found):
    calibration = found["calibration"]
    assert calibration["inverse_ratio"]["1 s"] < 1.5
    for level, share in calibration["healthy_beyond"].items():
        assert share <= float(level) + 3.0 * np.sqrt(float(level) / N_LANES)


@pytest.fixture(scope="module")
def tried():
    faulty, healthy = (simulate_suite_lanes(Thesis(), 0, N_LANES, calm) for calm in (False, True))
    own = log_likelihoods_known_severity(faulty)[:, np.arange(N_LANES), faulty.diagnosis].astype(
        float
    )
    low, _ = bootstrap(
        lambda some: delay_bound(detection_power(own[:, some], 10.0 * MEAN_TIME)), N_LANES, 0
    )
    return faulty, healthy, low


@pytest.mark.parametrize("name", ["oracle", "filter_bank", "integrated"])
def test_no_diagnoser_beats_the_detection_bound(name, tried):
    faulty, healthy, low = tried
    beliefs = [log_normal(name, lanes) for lanes in (faulty, healthy)]
    threshold = metrics.threshold_for(beliefs[1], MEAN_TIME, PERSISTENCE)
    alarm = metrics.alarms(beliefs[0], threshold, PERSISTENCE)
    delay = metrics.detection_delay(
        alarm, (faulty.first_faulty_sample - 1) * SAMPLE_TIME, HORIZON
    ).time
    assert delay.mean() > low


def log_normal(name, lanes):
    diagnoser = make(name)
    diagnoser.reset(len(lanes.first_faulty_sample))
    if hasattr(diagnoser, "tell"):
        diagnoser.set_truth(lanes.healthy, lanes.severity)
    return np.array(
        [diagnoser.update(observation).log_probability[:, 0] for observation in lanes.observations]
    )


def results(delay, isolation, upper=1.5):
    """Abrupt episodes of the first class and an incipient one, a diagnoser's, and bounds of 3 s and
    of 5 s.
    """
    kind = classes()[1]
    bound = {
        "classes": {
            kind: {
                "detection_delay": {"1 h": [3.0, 2.5, 3.5]},
                "delay_by_rate": np.linspace(6.0, 0.5, 23).tolist(),
            }
        },
        "all": {"isolation_delay": {"1 h": [5.0, 4.5, 5.5]}},
        "amoc": {"false_alarms_per_hour": AMOC_RATES.tolist()},
    }
    score = {
        "by_lane": {"detection": [*delay * FEWEST, 0.1], "isolation": [*isolation * FEWEST, 0.1]},
        "rates": {"1 h": {"false_alarms_per_hour_interval": [0.5, upper]}},
    }
    return {
        "bounds": {"thesis": bound},
        "scores": {"thesis": {"bold": score}},
        "episodes": {"fault": [1] * (2 * FEWEST + 1), "abrupt": [True] * 2 * FEWEST + [False]},
        "classes": list(classes()),
        "seeds": {"bootstrap": 0},
    }


def test_check_looks_at_abrupt_episodes_only_and_names_who_beats_a_bound():
    rows = check(results([4.0, 4.2], [6.0, 7.0]))
    assert [(row["what"], row["class"], row["beaten"]) for row in rows] == [
        ("detection", classes()[1], False),
        ("isolation", "all", False),
    ]
    assert rows[0]["measured"][0] == pytest.approx(4.1)
    assert [row["beaten"] for row in check(results([0.5, 0.6], [1.0, 2.0]))] == [True, True]


def test_check_leaves_out_classes_with_few_episodes():
    found = results([0.1, 0.1], [6.0, 7.0])
    found["episodes"]["abrupt"][FEWEST - 1 :] = [False] * (FEWEST + 2)
    assert [row["what"] for row in check(found)] == ["isolation"]


def test_check_allows_a_diagnoser_what_its_false_alarms_allow():
    careful, bold = (check(results([1.5, 1.6], [6.0, 7.0], upper))[0] for upper in (1.0, 400.0))
    assert careful["beaten"] and not bold["beaten"]
    assert bold["bound"][0] < careful["bound"][0]


def test_rates_are_in_samples():
    assert RATES == {"1 h": 36_000.0, "10 h": 360_000.0}
