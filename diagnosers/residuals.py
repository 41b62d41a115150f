"""Residuals of a vehicle's own relations in windows: an alarm beyond what healthy logs show."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import UNKNOWN
from diagnosers.bank.sensors import FIRST_READING
from diagnosers.diagnoser import (
    Belief,
    Recursive,
    fill_missing,
    join_odds,
    last_values,
    same_severity,
)
from diagnosers.relations.directions import directions, log_likelihood
from diagnosers.relations.episode import episode_windows
from diagnosers.relations.model import RelationModel, Standardised
from diagnosers.relations.table import as_table, from_table
from diagnosers.relations.windows import (
    DURATION,
    PUSH,
    Windows,
    is_steady,
    is_under_way,
    windows_of,
)
from diagnosers.storage import WEIGHTS, settings_of

PACKAGED = WEIGHTS / "residuals.safetensors"
PERSISTENT = 5  # windows in a row, a second apart, beyond a limit: an alarm
# The same for the net force: where the water's current changes, the speed through the water does,
# which every window of 15 s that contains it takes for a force.
PERSISTENT_PUSH = 20
COUNTS = ("zeros", "repeated values")  # of readings in a window
LASTING = 45  # windows, of the median that finds slight lasting changes
# of a window that the one a second before does not contain; only that is new evidence of a class
NEW_SHARE = 1.0 / DURATION
MEMORY = math.exp(-1.0 / 20.0)  # of the likelihood of classes, per window
UNKNOWN_LIKELIHOOD = -6.0  # log, of a window's residuals that no known fault explains
BY_COUNTS = -20.0  # log likelihood of other classes where zeros or repeated values are too many
SHARPNESS = 4.0  # log odds of a fault by the squared distance to the limit
LARGEST_LOG_ODDS = 30.0
UNIFORM_SEVERITY = (0.5, 0.29)  # mean and standard deviation: the severity is not estimated


class ResidualsState(NamedTuple):
    """What is remembered of every lane, lane first."""

    # (n_lanes, n_rows, n_channels), the readings up to the last that a window may end with; NaN
    # before the first
    rows: np.ndarray
    recent: np.ndarray  # (n_lanes, every, n_channels), those since then, from the first place on
    n_rows: np.ndarray  # (n_lanes,), readings so far
    moving: np.ndarray  # (n_lanes,), readings since the vehicle was at rest
    held: np.ndarray  # (n_lanes,), readings since the speed command changed; 0 without one
    ratios: np.ndarray  # (n_lanes, PERSISTENT_PUSH, n_rules), of the last windows, 1 at the limit
    history: np.ndarray  # (n_lanes, LASTING, n_residuals), standardised; NaN before the first
    evidence: np.ndarray  # (n_lanes, n_faults), log likelihood of the classes but normal
    log_probability: np.ndarray  # (n_lanes, n_classes), after the last judged window
    value: np.ndarray  # (n_lanes, n_rules), relative as in `Course`, of that window; NaN before
    limit: np.ndarray  # (n_lanes, n_rules)


class Course(NamedTuple):
    """An episode in windows, window first, by `Residuals.course`.

    Values and limits of the rules are relative: to what the relation predicts (the net force: to
    the drag), and shares of zeros and of repeated values in a window.
    """

    last: np.ndarray  # (n,), index of the last observation
    value: np.ndarray  # (n, n_rules); NaN where there are too few windows
    limit: np.ndarray  # (n, n_rules), of the absolute value
    std: np.ndarray  # (n, n_residuals), of a healthy vehicle, relative
    strength: np.ndarray  # (n, n_rules), how far beyond its limit each has stayed; 1 at the limit
    log_probability: np.ndarray  # (n, n_classes)


class Residuals(Recursive):
    """Limits on the residuals of relations that were fitted to healthy missions.

    The relations are those of net force, loads and voltages, see `diagnosers.relations.windows`.
    A window of 15 s is judged once a second while the vehicle is under way. The class is that whose
    direction in the space of the residuals explains them best (structured residuals; Gertler,
    "Fault Detection and Diagnosis in Engineering Systems", Dekker 1998, ch. 6); it is `unknown` if
    none does.

    When it misleads: it knows only what the healthy missions contained, and takes a fault in them
    for healthy. It is silent at rest and within the first 15 s, and a change of the net force has
    to last for 20 s more. It does not estimate the severity and does not read the accelerometer.
    A single odd reading counts for nothing, two in a row stay in the windows for 15 s; a reading
    that falls silent counts as one that repeats its last value.
    Without a shaft speed, propellers and drag are told apart by the ratio of current to voltage
    alone, and the voltage is only as good as the supply is constant.
    The default relations are those of an average vehicle of the simulated band: their limits are
    as wide as vehicles of the band differ, so that smaller faults pass, and for a real vehicle,
    which is in no such band, they mean nothing; `auv-fault calibrate` fits its own.

    Parameters
    ----------
    model
        Relations of the vehicle, or their table as `diagnosers.relations.table` has it; by default
        those of simulated vehicles with imperfect sensors (``auv-fault train residuals``).
    """

    name = "residuals"
    filled_channels: ClassVar[slice] = slice(0, 0)  # a row without readings is no row of zeros

    def __init__(self, model: RelationModel | Mapping[str, Any] | None = None):
        if model is None:
            model = settings_of(PACKAGED).get("model", {})
        self.model = from_table(model) if isinstance(model, Mapping) else model

    def settings(self) -> dict[str, Any]:
        """The relations as plain data."""
        return {"model": as_table(self.model)}

    @cached_property
    def rules(self) -> tuple[str, ...]:
        """What is compared with a limit: residuals, their lasting medians, and counts."""
        layout = self.model.layout
        counts = (f"{kind} of {name}" for name in layout.counted for kind in COUNTS)
        return (*layout.residuals, *map(lasting, layout.residuals), *counts)

    def initial(self, n_lanes: int) -> ResidualsState:
        """Nothing read yet."""
        layout = self.model.layout
        ratios = np.zeros((n_lanes, PERSISTENT_PUSH, len(self.rules)))
        evidence = np.zeros((n_lanes, len(self.classes) - 1))
        return ResidualsState(
            rows=np.full((n_lanes, layout.n_rows, len(CHANNELS)), np.nan),
            recent=np.full((n_lanes, layout.every, len(CHANNELS)), np.nan),
            n_rows=np.zeros(n_lanes, np.int64),
            moving=np.zeros(n_lanes, np.int64),
            held=np.zeros(n_lanes, np.int64),
            ratios=ratios,
            history=np.full((n_lanes, LASTING, len(layout.residuals)), np.nan),
            evidence=evidence,
            log_probability=log_probability(self._strength(ratios), evidence),
            value=np.full((n_lanes, len(self.rules)), np.nan),
            limit=np.full((n_lanes, len(self.rules)), np.nan),
        )

    def step(self, state: ResidualsState, observation: np.ndarray) -> tuple[ResidualsState, Belief]:
        """The next state and the belief."""
        arrived = has_reading(observation)
        state = with_row(state, observation, arrived)
        due = np.flatnonzero(arrived & (state.n_rows % self.model.layout.every == 0))
        if due.size:
            state = with_recent(state, due)
            lanes = due[state.moving[due] >= self.model.layout.n_rows]
            state = self._judged(state, lanes) if lanes.size else state
        return state, belief_of(state.log_probability)

    def course(self, observations: np.ndarray) -> Course:
        """What `update` finds along one episode, (n_samples, n_channels), from its beginning."""
        model = self.model
        nothing = np.zeros_like(observations)
        observations = fill_missing(observations, nothing, self.filled_channels)
        arrived = np.flatnonzero(has_reading(observations))
        rows = last_values(observations[arrived])
        windows, steady, last = episode_windows(rows, model.layout, model.typical)
        standardised = model.standardised(windows, steady)
        value, limit = self._compared(
            windows, standardised, so_far(standardised.residual, LASTING, math.nan)
        )
        ratio = ratio_of(value, limit)
        evidence = np.zeros((len(ratio), len(self.classes) - 1))
        beyond = np.flatnonzero(ratio.max(axis=1, initial=0.0) > 1.0)
        if beyond.size:
            evidence[beyond] = self._likelihood(
                windows.part(beyond), standardised.part(beyond), ratio[beyond]
            )
        for k in range(1, len(evidence)):
            evidence[k] += MEMORY * evidence[k - 1]
        strength = self._strength(so_far(ratio, PERSISTENT_PUSH, 0.0))
        relative = self._relative(standardised)
        return Course(
            last=arrived[last],
            value=value * relative,
            limit=limit * relative,
            std=1.0 / standardised.per_size,
            strength=strength,
            log_probability=log_probability(strength, evidence),
        )

    def beliefs(self, course: Course, n_samples: int) -> Belief:
        """The beliefs after every sample of an episode, (n_samples, n_classes) each."""
        first = self.initial(1).log_probability
        by_window = np.concatenate([first, course.log_probability])
        n_windows = np.searchsorted(course.last, np.arange(n_samples), side="right")
        return belief_of(by_window[n_windows])

    def _judged(self, state: ResidualsState, lanes: np.ndarray) -> ResidualsState:
        """The state after the windows of these lanes."""
        layout = self.model.layout
        windows = windows_of(state.rows[lanes], layout, self.model.typical)
        standardised = self.model.standardised(windows, is_steady(state.held[lanes], layout))
        history = state.history.copy()
        history[lanes] = pushed(history[lanes], standardised.residual)
        value, limit = self._compared(windows, standardised, history[lanes])
        ratio = ratio_of(value, limit)
        relative = self._relative(standardised)
        values = state.value.copy()
        values[lanes] = relative * value
        limits = state.limit.copy()
        limits[lanes] = relative * limit
        ratios = state.ratios.copy()
        ratios[lanes] = pushed(ratios[lanes], ratio)
        evidence = state.evidence.copy()
        evidence[lanes] *= MEMORY
        beyond = np.flatnonzero(ratio.max(axis=1) > 1.0)
        if beyond.size:
            likelihood = self._likelihood(
                windows.part(beyond), standardised.part(beyond), ratio[beyond]
            )
            evidence[lanes[beyond]] += likelihood
        return state._replace(
            ratios=ratios,
            history=history,
            evidence=evidence,
            log_probability=log_probability(self._strength(ratios), evidence),
            value=values,
            limit=limits,
        )

    def _compared(
        self, windows: Windows, standardised: Standardised, history: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values of the rules and their limits, (n, n_rules) each.

        Residuals are standardised; `history` (n, LASTING, n_residuals) has those of the last
        windows, NaN before the first.
        """
        layout = self.model.layout
        medians = np.array([self.model.lasting[name] for name in layout.residuals])
        shares = np.array([self.model.shares[name] for name in layout.counted])
        n = len(history)
        value = [
            standardised.residual,
            np.median(history, axis=1),
            windows.shares.reshape(n, shares.size),
        ]
        limit = [
            standardised.limit,
            np.broadcast_to(medians, (n, medians.size)),
            np.broadcast_to(shares.ravel(), (n, shares.size)),
        ]
        return np.hstack(value), np.hstack(limit)

    def _relative(self, standardised: Standardised) -> np.ndarray:
        """Factors (n, n_rules) on values and limits of the rules that make residuals relative."""
        relative = np.ones((len(standardised.per_size), len(self.rules)))
        n_residuals = standardised.per_size.shape[1]
        relative[:, : 2 * n_residuals] = np.tile(1.0 / standardised.per_size, 2)
        return relative

    def strongest(self, state: ResidualsState) -> np.ndarray:
        """The rule of each lane that has stayed farthest beyond its limit, (n_lanes,)."""
        return self._strength(state.ratios).argmax(axis=1)

    def _likelihood(
        self, windows: Windows, standardised: Standardised, ratio: np.ndarray
    ) -> np.ndarray:
        """Log likelihood of each fault by what is new in these windows, (n, n_faults)."""
        layout = self.model.layout
        found = log_likelihood(directions(self.model, windows), standardised)
        log_likelihoods = np.full((len(ratio), len(self.classes) - 1), BY_COUNTS)
        for name, value in found.items():
            log_likelihoods[:, self._fault(name)] = np.maximum(value, BY_COUNTS)
        log_likelihoods[:, self._fault(UNKNOWN)] = UNKNOWN_LIKELIHOOD
        share = ratio[:, 2 * len(layout.residuals) :].reshape(windows.shares.shape)
        too_many = (share > 1.0).any(axis=2)
        counted = np.flatnonzero(too_many.any(axis=1))
        faults = np.array([self._fault(f"sensor:{name}") for name in layout.counted])
        log_likelihoods[counted] += BY_COUNTS
        log_likelihoods[counted, faults[too_many[counted].argmax(axis=1)]] = 0.0
        return NEW_SHARE * log_likelihoods

    def _fault(self, name: str) -> int:
        """The column of a class among the faults."""
        return self.classes.index(name) - 1

    def _strength(self, ratios: np.ndarray) -> np.ndarray:
        """How far beyond its limit each rule has stayed, (n, n_rules); 1 at the limit.

        `ratios` (n, PERSISTENT_PUSH, n_rules) are those of the last windows.
        """
        lowest = ratios[:, -PERSISTENT:].min(axis=1)
        if PUSH in self.rules:
            push = self.rules.index(PUSH)
            lowest[:, push] = ratios[:, :, push].min(axis=1)
        return lowest


def lasting(residual: str) -> str:
    """The rule of the median of a residual."""
    return f"lasting {residual}"


def ratio_of(value: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Values relative to their limits, 1 at the limit; 0 where there is none yet."""
    return np.nan_to_num(np.abs(value) / limit)


def log_probability(strength: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Log probabilities (n, n_classes): even odds where a rule is at its limit."""
    strongest = strength.max(axis=1, keepdims=True)
    log_odds = np.minimum(SHARPNESS * (strongest**2 - 1.0), LARGEST_LOG_ODDS)
    return join_odds(log_odds, evidence - evidence.max(axis=1, keepdims=True))


def belief_of(log_probability: np.ndarray) -> Belief:
    """The belief, whose severities are not estimated; log probabilities are (n, n_classes)."""
    severity = same_severity(log_probability.shape, *UNIFORM_SEVERITY)
    for values in severity:
        values[:, -1] = 0.0
    return Belief(log_probability, *severity)


def so_far(values: np.ndarray, n: int, before: float) -> np.ndarray:
    """The last n values up to each, (n_values, n, n_columns), `before` the first this number."""
    padded = np.concatenate([np.full((n - 1, values.shape[1]), before), values])
    if not len(values):
        return padded[:0, None].repeat(n, axis=1)
    return np.swapaxes(np.lib.stride_tricks.sliding_window_view(padded, n, axis=0), 1, 2)


def with_row(state: ResidualsState, observation: np.ndarray, arrived: np.ndarray) -> ResidualsState:
    """The state with the readings of a sample, on the lanes (n_lanes,) where any arrived."""
    lanes = np.arange(len(observation))
    every = state.recent.shape[1]
    last = state.recent[lanes, (state.n_rows - 1) % every]
    row = np.where(np.isnan(observation), last, observation)
    recent = state.recent.copy()
    recent[lanes[arrived], state.n_rows[arrived] % every] = row[arrived]
    is_same = row[:, INDEX["mission_speed"]] == last[:, INDEX["mission_speed"]]
    held = np.where(arrived, np.where(is_same, state.held + 1, 0), state.held)
    moving = np.where(arrived, np.where(is_under_way(row), state.moving + 1, 0), state.moving)
    n_rows = state.n_rows + arrived
    return state._replace(recent=recent, n_rows=n_rows, held=held, moving=moving)


def with_recent(state: ResidualsState, lanes: np.ndarray) -> ResidualsState:
    """The state of which the recent readings of these lanes, all new, have joined the others."""
    every = state.recent.shape[1]
    rows = state.rows.copy()
    rows[lanes] = np.concatenate([rows[lanes, every:], state.recent[lanes]], axis=1)
    return state._replace(rows=rows)


def has_reading(observation: np.ndarray) -> np.ndarray:
    """Where any reading arrived, (n_lanes,)."""
    return np.isfinite(observation[:, FIRST_READING:]).any(axis=1)


def pushed(memory: np.ndarray, newest: np.ndarray) -> np.ndarray:
    """A memory (n_lanes, n, ...) without its oldest entry, and with the newest (n_lanes, ...)."""
    return np.concatenate([memory[:, 1:], newest[:, None]], axis=1)
