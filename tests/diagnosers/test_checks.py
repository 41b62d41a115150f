"""`check_diagnoser` catches diagnosers that break one rule each; a good one of one's own joins by
one line.
"""

from dataclasses import dataclass

import numpy as np
import pytest

import diagnosers
from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.errors import InputError
from diagnosers import REGISTRY, Belief, Entry, Recursive, check_diagnoser

SPEED = INDEX["speed"]


@dataclass(frozen=True)
class Mine(Recursive):
    """Two classes by the mean speed so far."""

    scale: float = 1.0

    name = "mine"

    def initial(self, n_lanes):
        return np.zeros(n_lanes), np.zeros(n_lanes)

    def step(self, state, observation):
        total = state[0] + observation[:, SPEED]
        count = state[1] + 1
        odds = self.scale * total / count
        log_probability = np.full((len(observation), len(self.classes)), -np.inf)
        log_probability[:, 0] = -np.logaddexp(0.0, odds)
        log_probability[:, 1:] = (-np.logaddexp(0.0, -odds) - np.log(len(self.classes) - 1))[
            :, None
        ]
        half = np.full(log_probability.shape, 0.5)
        return (total, count), Belief(log_probability, half, half.copy())


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(REGISTRY, "mine", Entry(Mine))


def altered(change):
    """`Mine` whose belief arrays go through ``change(probability, mean, std)``."""

    class Altered(Mine):
        def step(self, state, observation):
            state, belief = super().step(state, observation)
            return state, Belief(*change(*belief))

    return Altered()


class Growing(Mine):
    """Gives away the array that it goes on writing to."""

    def reset(self, n_lanes):
        super().reset(n_lanes)
        self.__dict__["_shared"] = np.zeros((n_lanes, len(self.classes)))

    def step(self, state, observation):
        state, belief = super().step(state, observation)
        self.__dict__["_shared"][:] = belief.log_probability
        return state, belief._replace(log_probability=self.__dict__["_shared"])


class Writing(Mine):
    def update(self, observation):
        belief = super().update(observation)
        observation[:] += 1.0
        return belief


class Forgetless(Mine):
    """Goes on where it was at the last reset."""

    def reset(self, n_lanes):
        state = self.running.state
        observation = self.running.observation
        super().reset(n_lanes)
        if observation is not None and len(observation) == n_lanes:
            self.running.state = state
            self.running.observation = observation


class Peeking(Mine):
    """Looks at all samples of the run, of which the one it gets is a view."""

    def update(self, observation):
        belief = super().update(observation)
        run = observation if observation.base is None else observation.base
        shift = 1e-3 * np.abs(np.nan_to_num(run)).mean()
        probability = belief.log_probability - [0.0, *[shift] * (len(self.classes) - 1)]
        total = np.log(np.exp(probability).sum(axis=1, keepdims=True))
        return belief._replace(log_probability=probability - total)


class Mixing(Mine):
    def step(self, state, observation):
        return super().step(state, np.tile(observation.mean(axis=0), (len(observation), 1)))


class Touchy(Mine):
    def update(self, observation):
        if np.isnan(observation).any():
            raise RuntimeError("no reading")
        return super().update(observation)


class Failing(Mine):
    def update(self, observation):
        raise ValueError("a mistake of its own")


class FailingInLibrary(Mine):
    def update(self, observation):
        return np.linalg.inv(np.zeros((2, 2)))


class Careless(Mine):
    def update(self, observation):
        n_lanes = len(self.running.observation)
        return super().update(np.resize(observation, (n_lanes, len(CHANNELS))))


class Unsaved(Mine):
    def settings(self):
        return {"scale": 2.0}


class Plain(Mine):
    def update(self, observation):
        return tuple(super().update(observation))


class Listed(Mine):
    classes = ["normal", "other"]


class Reversed(Mine):
    classes = ("increased_drag", "normal", "unknown")


class Sure(Mine):
    """Its classes explain whatever it reads."""

    classes = ("normal", "increased_drag")


BROKEN = {
    "list of classes": (Listed, "classes"),
    "normal is not first": (Reversed, "classes"),
    "nothing is unknown": (Sure, "classes: .*'unknown' last"),
    "shape": (lambda: altered(lambda p, m, s: (p[:, 1:], m, s)), "shape of log_probability"),
    "not finite": (lambda: altered(lambda p, m, s: (p, m * np.nan, s)), "severity_mean"),
    "does not sum to one": (
        lambda: altered(lambda p, m, s: (p - 0.1, m, s)),
        "sum of probabilities",
    ),
    "above zero": (lambda: altered(lambda p, m, s: (p + 20.0, m, s)), "log_probability"),
    "severity beyond one": (lambda: altered(lambda p, m, s: (p, m + 1.0, s)), "severity_mean"),
    "negative deviation": (lambda: altered(lambda p, m, s: (p, m, -s)), "severity_std"),
    "no belief": (Plain, "belief"),
    "returned arrays change": (Growing, "belief after later updates"),
    "observation changes": (Writing, "observation after update"),
    "looks ahead": (Peeking, "beliefs before another future"),
    "reset keeps something": (Forgetless, "second reset|later updates|another future"),
    "lanes mix": (Mixing, "lane 0 alone"),
    "silence": (Touchy, "missing: got RuntimeError"),
    "takes any shape": (Careless, "update with an observation of shape"),
    "load gives another": (Unsaved, "save and load"),
}


@pytest.mark.parametrize("case", BROKEN)
@pytest.mark.usefixtures("registered")
def test_a_broken_diagnoser_is_caught_in_one_line(case):
    broken, message = BROKEN[case]
    with pytest.raises(InputError, match=message) as caught:
        check_diagnoser(broken())
    text = str(caught.value)
    assert "\n" not in text and "got" in text and "allowed is" in text


@pytest.mark.parametrize("broken", [Failing, FailingInLibrary])
def test_a_mistake_in_update_is_told_by_its_place(broken):
    with pytest.raises(InputError) as caught:
        check_diagnoser(broken())
    line = broken.update.__code__.co_firstlineno + 1
    assert str(caught.value).endswith(
        f"; allowed is a belief; correct it in test_checks.py, line {line}"
    )


def test_a_missing_reading_that_breaks_update_gets_its_remedy():
    with pytest.raises(InputError, match="; take the last reading where one is missing, or corr"):
        check_diagnoser(Touchy())


@pytest.mark.usefixtures("registered")
def test_a_diagnoser_of_ones_own_joins_by_one_line():
    check_diagnoser(diagnosers.make("mine", scale=3.0), seed=7)
    assert "mine" in diagnosers.NAMES and "mine" in diagnosers.ranked()


def test_an_object_that_is_no_diagnoser_is_refused():
    with pytest.raises(InputError, match="diagnoser: got"):
        check_diagnoser(object())
