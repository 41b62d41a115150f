"""The content of an ONNX file: a trained network and the steps from its outputs to a belief.

PyTorch modules in float32; inputs and outputs are (n_lanes, n_columns). Features and estimates of
filters are inputs. A memory is one more input, `state`, zeros at the start of an episode, and one
more output, `next_state`. Sums of logarithms stand for products, which would underflow in float32.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import linear, pad, softplus

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief, Diagnoser
from diagnosers.diagnoser import IMPOSSIBLE, same_severity
from diagnosers.integrated import Integrated
from diagnosers.kalman import PARAMETERS
from diagnosers.kalman_network import KalmanNetwork
from diagnosers.networks.class_list import is_fault
from diagnosers.networks.fault_map import NOMINAL, SEVERITY_WEIGHTS
from diagnosers.networks.features import Features, feature_names
from diagnosers.networks.integrated_network import Network
from diagnosers.networks.modes import PRIOR_SEVERITY
from diagnosers.networks.numpy_network import N_MEMORY, n_outputs, smooth_opinion
from diagnosers.networks.smoothing import (
    FAULT_SMOOTHING,
    ODDS_SMOOTHING,
    update_share,
)
from diagnosers.parallel import Parallel
from diagnosers.raw_network import COLUMNS, PORT, SCALE, SPEED, STARBOARD, RawNetwork
from diagnosers.shafts import with_equal_readings
from training.active_env.vector import ActiveDiagnosisVectorEnv
from training.rollouts import manoeuvres, roll_out
from training.stimuli.base import BUDGET
from training.stimuli.policy import LAYERS, REACH, LearnedPolicy
from training.stimuli.policy_inputs import feature_names as feature_names_of_policy

Tensors = tuple[Tensor, ...]
NO_SHARE = -1e4  # logarithm of a share that is zero: finite, and its exponential is zero
EXAMPLE = (FaultEvent("motor_overheating:port", onset=15.0, severity=0.6),)
# of the example episode of an exported network
EXAMPLE_SAMPLES = 600
EXAMPLE_DECISIONS = 30


class Graph(nn.Module, ABC):
    """A module to export; `forward` takes `inputs` in their order, then the state if any."""

    inputs: Mapping[str, tuple[str, ...]]  # names of the columns, by input
    outputs: ClassVar[tuple[str, ...]] = Belief._fields
    n_state: int = 0  # columns of the state
    about: ClassVar[str]  # the values that the inputs take
    tensors: Mapping[str, np.ndarray]  # the weights, by name
    notes: dict[str, Any]  # the metadata of the file that explain the outputs

    def __init__(self, source: Diagnoser | LearnedPolicy, **constants: Any):
        super().__init__()
        self.source = source
        for name, values in constants.items():
            self.register_buffer(name, torch.tensor(values, dtype=torch.float32))

    @abstractmethod
    def episode(self, seed: int) -> dict[str, np.ndarray]:
        """The inputs, (n_samples, n_lanes, n_columns) float32, of one vehicle in an episode."""


class DiagnoserGraph(Graph):
    """A diagnoser, which reads the observations sample by sample."""

    def __init__(self, source: Diagnoser, **constants: Any):
        super().__init__(source, **constants)
        self.tensors = source.tensors()
        self.notes = {
            "diagnoser": source.name,
            "classes": source.classes,
            **source.settings(),
        }

    @abstractmethod
    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The inputs (n_samples, n_lanes, n_columns) float32 from observations, time first."""

    def episode(self, seed: int) -> dict[str, np.ndarray]:
        """The inputs, as of `feed`, of one vehicle in a minute during which a motor overheats."""
        stimulus = manoeuvres(seed, EXAMPLE_SAMPLES, 1)
        rollout = roll_out(Fleet(1), [seed], EXAMPLE_SAMPLES, stimulus, [EXAMPLE])
        return self.feed(rollout.observations)


class RawGraph(DiagnoserGraph):
    """The whole of `RawNetwork`."""

    inputs = {"observation": tuple(CHANNELS)}
    about = "observation: the last sample; the last reading of a channel where none arrived"

    def __init__(self, source: RawNetwork):
        severity = np.array(same_severity((1, len(source.known_classes)), *PRIOR_SEVERITY))
        super().__init__(source, scale=SCALE, log_shares=_log(source.shares), severity=severity)
        self.network = source.network

    def forward(self, observation: Tensor) -> Tensors:
        """The belief."""
        return _with_impossible_unknown(*self.of_known(observation))

    def of_known(self, observation: Tensor) -> Tensors:
        """The belief over the known classes."""
        inputs = [_columns(observation, [*side, SPEED]) / self.scale for side in COLUMNS]
        port, starboard = map(self.network, inputs)
        scores = _columns(port, PORT) + _columns(starboard, STARBOARD)
        log_probability = _log_mixture(torch.log_softmax(scores, dim=1), self.log_shares)
        return log_probability, *(moment.expand_as(log_probability) for moment in self.severity)

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The observations."""
        return {"observation": observations.astype(np.float32)}


class KalmanGraph(DiagnoserGraph):
    """`KalmanNetwork` behind its filter."""

    inputs = {"estimate": PARAMETERS[:2]}
    about = (
        "estimate: alpha and beta, relative to nominal, of diagnosers.kalman.ParameterFilter after "
        "the last sample"
    )

    def __init__(self, source: KalmanNetwork):
        calibration = {name: source.learnt[name] for name in ("slope", "offset")}
        constants = calibration | {
            "severity": source.severity.T,
            "log_shares": _log(source.shares),
        }
        super().__init__(source, **constants)
        self.network = source.network

    def forward(self, estimate: Tensor) -> Tensors:
        """The belief."""
        return _with_impossible_unknown(*self.of_known(estimate))

    def of_known(self, estimate: Tensor) -> Tensors:
        """The belief over the known classes."""
        points = estimate * torch.tensor(NOMINAL)
        sums = self.network(points.clamp(0.0, 1.0))
        log_modes = torch.log_softmax(self.slope * sums + self.offset, dim=1)
        weighted = torch.sigmoid(sums) * torch.tensor(SEVERITY_WEIGHTS)
        height = weighted.sum(dim=1, keepdim=True)
        intercept, slope, std = self.severity
        mean = (intercept + slope * height).clamp(0.0, 1.0)
        return _log_mixture(log_modes, self.log_shares), mean, std.expand_as(mean)

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The filter's estimates."""
        parameter_filter = self.source.filter
        estimate = parameter_filter.initial(observations.shape[1])
        columns = [parameter_filter.states.index(name) for name in self.inputs["estimate"]]
        means = []
        for observation in observations:
            observation = with_equal_readings(observation, self.source.vehicle)
            estimate = parameter_filter.update(estimate, observation)
            means.append(estimate.mean[:, columns].astype(np.float32))
        return {"estimate": np.stack(means)}


class ParallelGraph(DiagnoserGraph):
    """`Parallel` behind its filter."""

    inputs = RawGraph.inputs | KalmanGraph.inputs
    about = f"{RawGraph.about}; {KalmanGraph.about}"

    def __init__(self, source: Parallel):
        log_ratios = _log(np.array(source.ratios))
        super().__init__(source, log_prior=source.log_prior, log_ratios=log_ratios)
        self.raw = RawGraph(source.raw)
        self.kalman = KalmanGraph(source.kalman)

    def forward(self, observation: Tensor, estimate: Tensor) -> Tensors:
        """The belief."""
        by_shafts, *_ = self.raw.of_known(observation)
        by_hull, *severity = self.kalman.of_known(estimate)
        shafts = _log_mixture(by_shafts, self.log_ratios[0])
        hull = _log_mixture(by_hull, self.log_ratios[1])
        log_probability = torch.log_softmax(self.log_prior + shafts + hull, dim=1)
        return _with_impossible_unknown(log_probability, *severity)

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The observations and the filter's estimates."""
        return self.raw.feed(observations) | self.kalman.feed(observations)


class OneSample(nn.GRUCell):
    """A gated recurrent unit for one sample, because PyTorch exports `nn.GRU` as a loop."""

    def forward(self, inputs: Tensor, units: Tensor) -> Tensors:
        """Its output, which is its units, and the units."""
        units = super().forward(inputs, units)
        return units, units


class IntegratedGraph(DiagnoserGraph):
    """`Integrated` behind its features, over the classes of its training.

    State: units, mean opinion, smoothed odds and fault probabilities, and 1 after the first sample.
    """

    about = "features: of diagnosers.networks.features.Features after the last sample"
    outputs = (*Belief._fields, "next_state")

    def __init__(self, source: Integrated):
        trained = source.trained_classes
        n_faults = len(trained) - 1
        super().__init__(source, is_fault=[float(is_fault(name)) for name in trained])
        self.notes["classes"] = trained
        self.inputs = {"features": feature_names(trained)}
        self.widths = (N_MEMORY, n_outputs(len(trained)), 1, n_faults, 1)
        self.n_state = sum(self.widths)
        self.network = Network(OneSample, trained)
        weights = {name: torch.from_numpy(tensor) for name, tensor in self.tensors.items()}
        of_cell = {name.removesuffix("_l0"): weights[name] for name in weights}
        self.network.load_state_dict(of_cell)

    def forward(self, features: Tensor, state: Tensor) -> Tensors:
        """The belief and the next state."""
        units, previous, odds, faults, later = state.split(self.widths, dim=1)
        is_later = later > 0.0
        encoded, opinion = self.network.encode(features)
        opinion = torch.where(is_later, smooth_opinion(opinion, previous), opinion)
        outputs, units = self.network.recur(encoded, opinion, units)
        log_probability, mean, std = self.network.decode(outputs, features)
        odds, faults = _smoothed(log_probability, odds, faults, is_later)
        log_faults = torch.log_softmax(faults, dim=1) - softplus(-odds)
        log_probability = torch.cat([-softplus(odds), log_faults], dim=1)
        next_state = torch.cat([units, opinion, odds, faults, torch.ones_like(later)], dim=1)
        return log_probability, mean * self.is_fault, std * self.is_fault, next_state

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The features."""
        source = self.source
        recursion = Features(source.vehicle, source.trained_classes, source.bank)
        state = recursion.initial(observations.shape[1])
        rows = []
        for observation in observations.astype(np.float64):
            state, features, _ = recursion.step(state, observation)
            rows.append(features)
        return {"features": np.stack(rows)}


class PolicyGraph(Graph):
    """The whole of `LearnedPolicy`."""

    outputs = ("action",)
    about = (
        "features: of training.stimuli.policy_inputs, at every sample; the commanded speed is then "
        "the mission's plus the action times `reach` times the budget [m/s]"
    )

    def __init__(self, source: LearnedPolicy):
        super().__init__(source, **source.tensors)
        self.inputs = {"features": source.features}
        self.tensors = source.tensors
        self.notes = {"diagnoser": source.diagnoser, "reach": REACH}

    def forward(self, features: Tensor) -> Tensor:
        """The action."""
        for layer in LAYERS:
            weight = getattr(self, f"{layer}_weight")
            bias = getattr(self, f"{layer}_bias")
            features = torch.tanh(linear(features, weight, bias))
        return features

    def episode(self, seed: int) -> dict[str, np.ndarray]:
        """The features (n_decisions, 1, n_features) of a vehicle that follows the policy."""
        env = ActiveDiagnosisVectorEnv(diagnoser=self.source.diagnoser, budget=BUDGET)
        names = feature_names_of_policy(env.classes)
        columns = [names.index(name) for name in self.source.features]
        rows = []
        observation, _ = env.reset(seed=seed)
        for _ in range(EXAMPLE_DECISIONS):
            rows.append(observation[:, columns])
            offset = REACH * BUDGET * self.source.action(rows[-1])
            observation, *_ = env.step(offset / env.amplitude)
        env.close()
        return {"features": np.stack(rows)}


GRAPHS: dict[str, type[Graph]] = {
    "raw_network": RawGraph,
    "kalman_network": KalmanGraph,
    "parallel": ParallelGraph,
    "integrated": IntegratedGraph,
}


def _columns(values: Tensor, columns: list[int]) -> Tensor:
    """Some columns; plain indices would become a chain of transpositions in the file."""
    return values.index_select(1, torch.tensor(columns))


def _with_impossible_unknown(log_probability: Tensor, mean: Tensor, std: Tensor) -> Tensors:
    """As `diagnosers.diagnoser.with_impossible_unknown`."""
    last = (0, 1)
    return pad(log_probability, last, value=IMPOSSIBLE), pad(mean, last), pad(std, last)


def _log(shares: np.ndarray) -> np.ndarray:
    """Logarithm of shares of which some are zero."""
    return np.log(shares, out=np.full(shares.shape, NO_SHARE), where=shares > 0.0)


def _log_mixture(log_parts: Tensor, log_shares: Tensor) -> Tensor:
    """Log of the sum of parts times shares, (n_lanes, n_classes), from the logs of both."""
    return torch.logsumexp(log_parts[:, :, None] + log_shares, dim=1)


def _smoothed(log_probability: Tensor, odds: Tensor, faults: Tensor, is_later: Tensor) -> Tensors:
    """`SmoothedBelief.after`, with the logarithms of the averaged fault probabilities."""
    log_faults = log_probability[:, 1:]
    now = torch.logsumexp(log_faults, dim=1, keepdim=True) - log_probability[:, :1]
    falling = odds + update_share(ODDS_SMOOTHING) * (now - odds)
    share = update_share(FAULT_SMOOTHING)
    new = log_faults + float(np.log(share))
    old = faults + float(np.log1p(-share))
    averaged = torch.maximum(new, old) + softplus(-(new - old).abs())
    odds = torch.where(is_later, torch.maximum(now, falling), now)
    return odds, torch.where(is_later, averaged, new)
