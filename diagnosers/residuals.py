"""Residuals of a vehicle's own relations in windows: an alarm beyond what healthy logs show."""

import math
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from auv_fault_env.channels import CHANNELS, INDEX
from auv_fault_env.faults import UNKNOWN
from diagnosers.bank.sensors import FIRST_READING
from diagnosers.diagnoser import Belief, Recursive, join_odds, same_severity
from diagnosers.relations.directions import directions, log_likelihood
from diagnosers.relations.model import RelationModel, Standardised
from diagnosers.relations.windows import PUSH, Windows, is_steady, is_under_way, windows_of

PERSISTENT = 5  # windows in a row, a second apart, beyond a limit: an alarm
# The same for the net force: where the water's current changes, the speed through the water does,
# which every window of 15 s that contains it takes for a force.
PERSISTENT_PUSH = 20
LASTING = 45  # windows, of the median that finds slight lasting changes
MEMORY = math.exp(-1.0 / 20.0)  # of the likelihood of classes, per window
UNKNOWN_LIKELIHOOD = -6.0  # log, of a window's residuals that no known fault explains
BY_COUNTS = -20.0  # log likelihood of other classes where zeros or repeated values are too many
SHARPNESS = 4.0  # log odds of a fault by the squared distance to the limit
LARGEST_LOG_ODDS = 30.0
UNIFORM_SEVERITY = (0.5, 0.29)  # mean and standard deviation: the severity is not estimated


class ResidualsState(NamedTuple):
    """What is remembered of every lane, lane first."""

    rows: np.ndarray  # (n_lanes, n_rows, n_channels), the last readings; NaN before the first
    n_rows: np.ndarray  # (n_lanes,), readings so far
    held: np.ndarray  # (n_lanes,), readings since the speed command changed; 0 without one
    # (n_lanes, PERSISTENT_PUSH, n_ratios), of the last windows, 1 at the limit: each residual, the
    # largest median, and the largest share of zeros or repeated values
    ratios: np.ndarray
    history: np.ndarray  # (n_lanes, LASTING, n_residuals), standardised; NaN before the first
    evidence: np.ndarray  # (n_lanes, n_faults), log likelihood of the classes but normal
    log_probability: np.ndarray  # (n_lanes, n_classes), after the last judged window


class Residuals(Recursive):
    """Limits on the residuals of relations that were fitted to healthy logs of the vehicle.

    The relations are those of net force, loads and voltages, see `diagnosers.relations.windows`.
    A window of 15 s is judged once a second while the vehicle is under way. The class is that whose
    direction in the space of the residuals explains them best (structured residuals; Gertler,
    "Fault Detection and Diagnosis in Engineering Systems", Dekker 1998, ch. 6); it is `unknown` if
    none does.

    When it misleads: it knows only what the healthy logs contained, and takes a fault in them for
    healthy. It is silent at rest and within the first 15 s. It does not estimate the severity.
    Without a shaft speed, propellers and drag are told apart by the ratio of current to voltage
    alone, and the voltage is only as good as the supply is constant.
    """

    name = "residuals"
    filled_channels: ClassVar[slice] = slice(0, 0)  # a row without readings is no row of zeros

    def __init__(self, model: RelationModel):
        self.model = model

    @cached_property
    def _every(self) -> int:
        """Readings from one judged window to the next."""
        return max(1, round(self.model.layout.sample_rate))

    def initial(self, n_lanes: int) -> ResidualsState:
        """Nothing read yet."""
        layout = self.model.layout
        n_ratios = len(layout.residuals) + 2
        ratios = np.zeros((n_lanes, PERSISTENT_PUSH, n_ratios))
        evidence = np.zeros((n_lanes, len(self.classes) - 1))
        return ResidualsState(
            rows=np.full((n_lanes, layout.n_rows, len(CHANNELS)), np.nan),
            n_rows=np.zeros(n_lanes, np.int64),
            held=np.zeros(n_lanes, np.int64),
            ratios=ratios,
            history=np.full((n_lanes, LASTING, len(layout.residuals)), np.nan),
            evidence=evidence,
            log_probability=self._log_probability(ratios, evidence),
        )

    def step(self, state: ResidualsState, observation: np.ndarray) -> tuple[ResidualsState, Belief]:
        """The next state and the belief."""
        state = with_row(state, observation)
        due = window_is_due(state, observation, self._every)
        if due.any():
            state = self._judged(state, np.flatnonzero(due))
        severity = same_severity(state.log_probability.shape, *UNIFORM_SEVERITY)
        for values in severity:
            values[:, -1] = 0.0
        return state, Belief(state.log_probability, *severity)

    def _judged(self, state: ResidualsState, lanes: np.ndarray) -> ResidualsState:
        """The state after the windows of these lanes."""
        layout = self.model.layout
        windows = windows_of(state.rows[lanes], layout, self.model.typical)
        standardised = self.model.standardised(windows, is_steady(state.held[lanes], layout))
        history = state.history.copy()
        history[lanes] = pushed(history[lanes], standardised.residual)
        lasting = np.array([self.model.lasting[name] for name in layout.residuals])
        # NaN as long as there are fewer windows
        median = np.nan_to_num(np.abs(np.median(history[lanes], axis=1)) / lasting)
        most_shares = np.array([self.model.shares[name] for name in layout.counted])
        share = windows.shares / most_shares
        at_once = np.abs(standardised.residual) / standardised.limit
        ratio = np.column_stack([at_once, median.max(axis=1), share.max(axis=(1, 2))])
        ratios = state.ratios.copy()
        ratios[lanes] = pushed(ratios[lanes], ratio)
        evidence = state.evidence.copy()
        evidence[lanes] *= MEMORY
        beyond = np.flatnonzero(ratio.max(axis=1) > 1.0)
        if beyond.size:
            likelihood = self._likelihood(
                windows.part(beyond), standardised.part(beyond), share[beyond]
            )
            evidence[lanes[beyond]] += likelihood
        return state._replace(
            ratios=ratios,
            history=history,
            evidence=evidence,
            log_probability=self._log_probability(ratios, evidence),
        )

    def _likelihood(
        self, windows: Windows, standardised: Standardised, share: np.ndarray
    ) -> np.ndarray:
        """Log likelihood of every class but normal by these windows, (n, n_faults)."""
        found = log_likelihood(directions(self.model, windows), standardised)
        log_likelihoods = np.full((len(share), len(self.classes) - 1), BY_COUNTS)
        for name, value in found.items():
            log_likelihoods[:, self._fault(name)] = np.maximum(value, BY_COUNTS)
        log_likelihoods[:, self._fault(UNKNOWN)] = UNKNOWN_LIKELIHOOD
        too_many = (share > 1.0).any(axis=2)
        counted = np.flatnonzero(too_many.any(axis=1))
        faults = np.array([self._fault(f"sensor:{name}") for name in self.model.layout.counted])
        log_likelihoods[counted] += BY_COUNTS
        log_likelihoods[counted, faults[too_many[counted].argmax(axis=1)]] = 0.0
        return log_likelihoods

    def _fault(self, name: str) -> int:
        """The column of a class among the faults."""
        return self.classes.index(name) - 1

    def _strength(self, ratios: np.ndarray) -> np.ndarray:
        """How far beyond its limit a residual has stayed, (n_lanes, 1); 1 at the limit."""
        lowest = ratios[:, -PERSISTENT:].min(axis=1)
        if PUSH in self.model.layout.residuals:
            push = self.model.layout.residuals.index(PUSH)
            lowest[:, push] = ratios[:, :, push].min(axis=1)
        return lowest.max(axis=1, keepdims=True)

    def _log_probability(self, ratios: np.ndarray, evidence: np.ndarray) -> np.ndarray:
        """Log probabilities (n_lanes, n_classes): even odds where a residual is at its limit."""
        strength = self._strength(ratios)
        log_odds = np.minimum(SHARPNESS * (strength**2 - 1.0), LARGEST_LOG_ODDS)
        return join_odds(log_odds, evidence - evidence.max(axis=1, keepdims=True))


def with_row(state: ResidualsState, observation: np.ndarray) -> ResidualsState:
    """The state with the readings of a sample, where any arrived."""
    arrived = has_reading(observation)
    last = state.rows[:, -1]
    row = np.where(np.isnan(observation), last, observation)
    rows = np.where(arrived[:, None, None], pushed(state.rows, row), state.rows)
    is_same = row[:, INDEX["mission_speed"]] == last[:, INDEX["mission_speed"]]
    held = np.where(arrived, np.where(is_same, state.held + 1, 0), state.held)
    return state._replace(rows=rows, n_rows=state.n_rows + arrived, held=held)


def window_is_due(state: ResidualsState, observation: np.ndarray, every: int) -> np.ndarray:
    """Whether a window is to be judged, (n_lanes,): whole, with a command above 0 all the while."""
    is_whole = state.n_rows >= state.rows.shape[1]
    is_moving = is_under_way(state.rows).all(axis=1)
    return has_reading(observation) & is_whole & is_moving & (state.n_rows % every == 0)


def has_reading(observation: np.ndarray) -> np.ndarray:
    """Where any reading arrived, (n_lanes,)."""
    return np.isfinite(observation[:, FIRST_READING:]).any(axis=1)


def pushed(memory: np.ndarray, newest: np.ndarray) -> np.ndarray:
    """A memory (n_lanes, n, ...) without its oldest entry, and with the newest (n_lanes, ...)."""
    return np.concatenate([memory[:, 1:], newest[:, None]], axis=1)
