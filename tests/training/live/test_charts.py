import json

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import NORMAL, classes
from diagnosers import Belief
from training.live.charts import CHARTS
from training.live.history import History, Mark
from training.live.texts import belief_text

PORT_LOSS = classes().index("propeller_loss:port")


@pytest.fixture
def history():
    """Four samples: from the second on the port propeller is gone, from the third on that is
    believed and alarmed.
    """
    probability = np.full((4, len(classes())), 1e-3 / (len(classes()) - 1))
    probability[:2, 0] = probability[2:, PORT_LOSS] = 1.0 - 1e-3
    mean = np.full(probability.shape, 0.5)
    mean[:, PORT_LOSS] = 0.9
    return History(
        np.array([69.7, 69.8, 69.9, 70.0]),
        np.arange(4 * len(CHANNELS), dtype=np.float32).reshape(4, -1),
        Belief(np.log(probability), mean, np.full(probability.shape, 0.1)),
        np.array([False, False, True, True]),
        np.array([0.3, 0.3, 0.2, 0.1]),
        (Mark(69.8, "fault"),),
    )


def named(options, name):
    return next(series for series in options["series"] if series["name"] == name)


@pytest.mark.parametrize("truth", [False, True])
@pytest.mark.parametrize("name", CHARTS)
def test_every_chart_is_plain_data_with_title_and_axes(history, name, truth):
    options = CHARTS[name](history, truth)
    assert json.loads(json.dumps(options, allow_nan=False)) == options
    assert options["title"]["text"]
    assert options["xAxis"] and options["yAxis"]


@pytest.mark.parametrize("name", [name for name in CHARTS if name != "ranking"])
def test_fault_and_alarm_are_marked(history, name):
    series = CHARTS[name](history, False)["series"][0]
    assert [(line["name"], line["xAxis"]) for line in series["markLine"]["data"]] == [
        ("fault", 69.8)
    ]
    ((begin, end),) = series["markArea"]["data"]
    assert (begin["name"], begin["xAxis"], end["xAxis"]) == ("alarm", 69.9, 70.0)


def test_the_last_minute_is_shown(history):
    axis = CHARTS["speed"](history, False)["xAxis"]
    assert (axis["min"], axis["max"]) == (10.0, 70.0)


def test_lines_carry_their_channel(history):
    column = INDEX["starboard_rpm"]
    line = named(CHARTS["rpm"](history, False), "starboard")
    assert line["data"] == [
        [time, column + 12.0 * k] for k, time in enumerate((69.7, 69.8, 69.9, 70.0))
    ]


def test_the_true_speed_is_shown_only_with_the_truth(history):
    without, given = (CHARTS["speed"](history, truth)["series"] for truth in (False, True))
    assert [series["name"] for series in without] == ["mission", "command", "measured"]
    assert given[-1]["name"] == "true" and [y for _, y in given[-1]["data"]] == [0.3, 0.3, 0.2, 0.1]


def test_the_likeliest_is_on_top_and_has_the_severity(history):
    ranking = CHARTS["ranking"](history, False)
    assert ranking["yAxis"]["data"][-1] == "propeller_loss:port"
    assert ranking["series"][0]["data"][-1]["value"] == 99.9
    severity = CHARTS["severity"](history, False)
    assert named(severity, "propeller_loss:port")["data"] == [
        [69.7, None],
        [69.8, None],
        [69.9, 0.9],
        [70.0, 0.9],
    ]
    assert named(severity, "low")["data"][-1][1] == pytest.approx(0.9 - 0.196)
    assert named(severity, "95 % interval")["data"][-1][1] == pytest.approx(1.0 - (0.9 - 0.196))


def test_verdict_needs_an_alarm_and_half_of_the_probability(history):
    assert history.verdict == "propeller_loss:port"
    assert history._replace(alarm=np.zeros(4, bool)).verdict == NORMAL
    even = np.log(np.full((4, len(classes())), 1.0 / len(classes())))
    assert (
        history._replace(belief=history.belief._replace(log_probability=even)).verdict == "unknown"
    )


def test_an_unknown_fault_has_no_severity_in_the_text(history):
    assert belief_text(history).endswith("propeller_loss:port: 99.9 %, severity 0.90 (0.70–1.00)")
    log_probability = history.belief.log_probability.copy()
    log_probability[:, [PORT_LOSS, -1]] = log_probability[:, [-1, PORT_LOSS]]
    belief = history.belief._replace(log_probability=log_probability)
    assert belief_text(history._replace(belief=belief)).endswith("· unknown: 99.9 %")


def test_alarms_begin_and_end(history):
    alarm = np.array([True, False, True, True])
    assert history._replace(alarm=alarm).alarms() == [(69.7, 69.8), (69.9, 70.0)]


def hint(options):
    return options["graphic"][0]["style"]["text"]


@pytest.mark.parametrize("name", [name for name in CHARTS if name != "ranking"])
def test_an_empty_chart_says_what_appears_and_when(history, name):
    first = [values[:1] for values in history[:2]]
    belief = Belief(*(values[:1] for values in history.belief))
    at_start = History(*first, belief, history.alarm[:1], history.true_speed[:1], ())
    assert hint(CHARTS[name](at_start, False)) == "Press START: the last minute appears here."
    assert hint(CHARTS[name](history, False)) == ""


def test_the_severity_says_when_it_appears(history):
    healthy = Belief(*(values[[0, 0, 0, 0]] for values in history.belief))
    options = CHARTS["severity"](history._replace(belief=healthy), False)
    assert hint(options) == "Appears when a fault reaches 5 %."
    assert not options["legend"]["show"]
    assert CHARTS["severity"](history, False)["legend"]["show"]


@pytest.mark.parametrize("truth", [False, True])
@pytest.mark.parametrize("name", [name for name in CHARTS if name not in ("ranking", "severity")])
def test_every_line_of_a_chart_has_its_own_colour(history, name, truth):
    colours = [series["color"] for series in CHARTS[name](history, truth)["series"]]
    assert len(set(colours)) == len(colours)


def test_a_class_has_the_same_colour_on_all_charts(history):
    bar = CHARTS["ranking"](history, False)["series"][0]["data"][-1]
    colour = bar["itemStyle"]["color"]
    for name in ("belief", "severity"):
        assert named(CHARTS[name](history, False), "propeller_loss:port")["color"] == colour


def test_a_negligible_bar_says_so(history):
    bars = CHARTS["ranking"](history, False)["series"][0]["data"]
    assert [bar.get("label", {}).get("formatter") for bar in bars] == ["< 0.1"] * 5 + [None]
