"""Diagnosers of other people join by module, by file or by entry point, and break in one line if
they must.
"""

import pickle
import sys

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from auv_fault_env.faults import classes
from diagnosers import check_diagnoser
from diagnosers.diagnoser import Diagnoser
from diagnosers.sample_adapter import LEAST_PROBABILITY, SampleAdapter
from diagnosers.third_party import ForeignCodeError, ThirdParty, installed_third_parties

OURS = """
from diagnosers.references import Null
class Mine(Null):
    name = "mine"
"""
THEIRS = """
class Theirs:
    faults = ("increased_drag", "propeller_loss:port", "unknown")
    def Initialize(self):
        self.count = 0
    def Input(self, sample):
        assert list(sample.columns[:2]) == ["time", "mission_speed"] and len(sample) == 1
        assert abs(sample["time"].iloc[0] - 0.1 * self.count) < 1e-9
        self.count += 1
        if self.count < 3:
            return False, [0.0, 0.0, 0.0]
        return [1], [[0.1, 0.5, 0.4]]
"""
BROKEN = {
    "exits": ("raise SystemExit(3)", "SystemExit"),
    "stumbles": ("import nowhere_at_all", "No module named 'nowhere_at_all'"),
    "is_empty": ("", "got 'Mine'; allowed is a class, and it has none"),
    "is_mistyped": ("class Mien: ...", "allowed is one of Mien; did you mean 'Mien'?"),
    "is_no_class": ("Mine = 3", "3; allowed is a class"),
    "raises": (
        "class Mine:\n    def __init__(self):\n        raise RuntimeError('no\\nidea')",
        "RuntimeError",
    ),
    "wants": ("class Mine:\n    def __init__(self, size): ...", "without arguments"),
    "is_something_else": ("class Mine: ...", "reset and update, or with Input"),
}


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


def written(place, name, text):
    (place / f"{name}.py").write_text(text)
    return place / f"{name}.py"


def believe(diagnoser):
    diagnoser.reset(2)
    belief = np.exp(diagnoser.update(np.zeros((2, len(CHANNELS)))).log_probability)
    np.testing.assert_allclose(belief.sum(axis=1), 1.0)


def test_a_class_joins_by_module_and_by_file(place, monkeypatch):
    path = written(place, "mine_of_a_test", OURS)
    monkeypatch.chdir(place)
    for target in ("mine_of_a_test:Mine", f"{path}:Mine", "mine_of_a_test.py:Mine"):
        party = ThirdParty(target)
        assert party.name == "mine"
        assert type(party()).__name__ == "Mine"
        assert party.source == path
        believe(party())


def test_a_party_means_the_same_in_another_process_and_folder(place, monkeypatch):
    written(place, "mine_of_a_test", OURS)
    monkeypatch.chdir(place)
    party = ThirdParty("mine_of_a_test.py:Mine")
    monkeypatch.chdir("/")
    assert isinstance(pickle.loads(pickle.dumps(party))(), Diagnoser)


def test_an_installed_package_joins_by_its_entry_point(place):
    written(place, "mine_of_a_test", OURS)
    info = place / "their_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-package\nVersion: 1.0\n")
    points = (
        "[auv_fault.diagnosers]\nas_they_say = mine_of_a_test:Mine\nbroken = nowhere_at_all:Mine\n"
    )
    (info / "entry_points.txt").write_text(points)
    parties = dict(installed_third_parties())
    assert list(parties) == ["as_they_say", "broken"]
    believe(parties["as_they_say"]())
    with pytest.raises(InputError, match="nowhere_at_all"):
        parties["broken"]()


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_refused_in_one_line(place, name):
    text, word = BROKEN[name]
    with pytest.raises(InputError) as refused:
        ThirdParty(f"{written(place, name, text)}:Mine")()
    assert word in str(refused.value) and f"{name}.py" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "target",
    [
        "nowhere_at_all:Mine",
        "/nowhere/mine.py:Mine",
        "nothing",
        ":",
        "mine.py",
        ".mine:Mine",
        f"{300 * 'm'}.py:Mine",
        "m\0.py:Mine",
    ],
)
def test_what_is_not_there_is_refused_in_one_line(target):
    with pytest.raises(InputError, match="what can be imported, module:Class or path/to/file") as e:
        ThirdParty(target)()
    assert not isinstance(e.value, ForeignCodeError)


@pytest.mark.parametrize("target", ["mine.py", "mine.py:"])
def test_a_file_without_its_class_is_told_to_name_one(target):
    with pytest.raises(InputError, match=r"; name its class: \S*mine\.py:Class$"):
        ThirdParty(target)()


@pytest.mark.parametrize(
    "name",
    ["61 * 'x'", "'\\ud800'", "'\\U0001f600'", "'\\x1b[2J'", "'$\\\\frac'", "'../mine'", "'a\\nb'"],
)
def test_a_name_is_text_that_files_and_figures_can_have(place, name):
    path = written(place, "mine_of_a_test", OURS + f"class Other(Mine):\n    name = {name}")
    with pytest.raises(ForeignCodeError, match="up to 60 letters") as refused:
        _ = ThirdParty(f"{path}:Other").name
    assert str(refused.value).isprintable()


def test_a_name_that_is_no_text_is_that_of_the_class(place):
    text = OURS + "class Other(Mine):\n    name = property(lambda self: 3)\n"
    path = written(place, "mine_of_a_test", text)
    assert ThirdParty(f"{path}:Other").name == "Other"


def test_a_system_of_one_sample_becomes_a_diagnoser_of_lanes(place):
    pytest.importorskip("pandas")
    path = written(place, "theirs_of_a_test", THEIRS)
    party = ThirdParty(f"{path}:Theirs")
    check_diagnoser(party())
    diagnoser = party()
    assert isinstance(diagnoser, SampleAdapter)
    diagnoser.reset(2)
    beliefs = [
        np.exp(diagnoser.update(np.zeros((2, len(CHANNELS)))).log_probability) for _ in range(3)
    ]
    names = list(classes())
    quiet = beliefs[0][1]
    sure = beliefs[2][1]
    assert quiet[0] == pytest.approx(1.0 - LEAST_PROBABILITY, abs=1e-15)
    assert sure[0] == pytest.approx(LEAST_PROBABILITY, rel=1e-6)
    assert sure[names.index("increased_drag")] == pytest.approx(0.1)
    assert sure[names.index("propeller_loss:port")] == pytest.approx(0.5)
    assert sure[-1] == pytest.approx(0.4) and names[-1] == "unknown"
    assert sure[names.index("sensor:speed")] < 1e-40  # has no column
    # nothing isolated is unknown
    assert quiet[-1] == pytest.approx(LEAST_PROBABILITY)
    assert quiet[names.index("increased_drag")] < 1e-40


class Fixed:
    """Answers what it is made to answer."""

    answer = 0, np.zeros(18)

    def Input(self, sample):
        return self.answer


def belief(answer, faults=None):
    members = {"answer": answer} | ({} if faults is None else {"faults": faults})
    diagnoser = SampleAdapter(type("Given", (Fixed,), members))
    diagnoser.reset(1)
    return np.exp(diagnoser.update(np.zeros((1, len(CHANNELS)))).log_probability[0])


def test_detection_says_whether_and_isolation_which():
    pytest.importorskip("pandas")
    sure = np.eye(18)[4] * 7.0  # scaled to 1
    # sure of a fault, but none detected: normal
    assert belief((0, sure))[5] == pytest.approx(LEAST_PROBABILITY)
    assert belief((0, sure))[0] == pytest.approx(1.0)
    assert belief((0.25, sure))[[0, 5]] == pytest.approx([0.75, 0.25])
    # detected, and no idea which
    assert belief((1, np.zeros(18)))[-1] == pytest.approx(1.0)
    assert belief((1, [1.0]), faults=["unknown"])[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("answer", "faults", "word"),
    [
        ((2, np.zeros(18)), None, "detection"),
        ((np.nan, np.zeros(18)), None, "detection"),
        (([0, 1], np.zeros(18)), None, "detection"),
        ((1, np.zeros(5)), None, "isolation: .* 18 numbers"),
        ((1, -np.ones(18)), None, "isolation"),
        ((1, np.full(18, np.nan)), None, "isolation"),
        ((1, [1.0]), ["increased_drug"], "did you mean 'increased_drag'"),
        ((1, [0.5, 0.5]), ["increased_drag", "increased_drag"], "different names"),
    ],
)
def test_a_system_that_breaks_the_interface_is_refused(answer, faults, word):
    pytest.importorskip("pandas")
    with pytest.raises(InputError, match=word):
        belief(answer, faults)


def test_no_update_before_a_reset():
    with pytest.raises(InputError, match="call reset"):
        SampleAdapter(Fixed).update(np.zeros((1, len(CHANNELS))))


def test_a_party_is_made_anew_each_time(place):
    party = ThirdParty(f"{written(place, 'mine_of_a_test', OURS)}:Mine")
    assert party() is not party()
    assert type(party()) is type(party())
