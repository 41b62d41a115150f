"""What goes into an ONNX file: a trained network with all that stands between its inputs and its answer.

PyTorch modules in float32; inputs and outputs are (n_lanes, n_columns). Filters and features stay
outside: their equations are those of `diagnosers`, and what they say is an input. A memory is one
more input, `state`, zeros at the start of an episode, and one more output, `next_state`. What is a
product of probabilities in `diagnosers` is a sum of logarithms here, which float32 does not
underflow.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import torch
from torch import nn
from torch.nn.functional import linear, softplus

from auv_fault_env.channels import CHANNELS
from auv_fault_env.fleet import Fleet
from auv_fault_env.schedules import FaultEvent
from diagnosers import Belief, Diagnoser
from diagnosers.diagnoser import same_severity
from diagnosers.integrated import N_CLASSES, N_MEMORY, N_OUTPUTS, Integrated, smooth_opinion
from diagnosers.kalman import PARAMETERS
from diagnosers.kalman_network import KalmanNetwork
from diagnosers.networks.fault_map import NOMINAL, SEVERITY_WEIGHTS
from diagnosers.networks.features import FEATURES, Features
from diagnosers.networks.integrated_network import Network
from diagnosers.networks.modes import PRIOR_SEVERITY
from diagnosers.networks.smoothing import FAULT_SMOOTHING, ODDS_SMOOTHING, update_share
from diagnosers.parallel import Parallel
from diagnosers.raw_network import COLUMNS, PORT, SCALE, SPEED, STARBOARD, RawNetwork
from training.active_env.vector import ActiveDiagnosisVectorEnv
from training.rollouts import manoeuvres, roll_out
from training.stimuli import policy_inputs
from training.stimuli.policy import LAYERS, LearnedPolicy

IMPOSSIBLE = -1e4  # logarithm of a share that is zero: finite, and its exponential is zero
EXAMPLE = (FaultEvent("motor_overheating:port", onset=15.0, severity=0.6),)
# of an episode to try an exported network on
EXAMPLE_SAMPLES = 600
EXAMPLE_DECISIONS = 30


class Graph(nn.Module, ABC):
    """A module to export; `forward` takes its `inputs` in their order, and the state if it has one."""

    inputs: ClassVar[Mapping[str, tuple[str, ...]]]  # names of the columns, by input
    outputs: ClassVar[tuple[str, ...]] = Belief._fields
    n_state: ClassVar[int] = 0  # columns of the state
    about: ClassVar[str]  # what to feed it with

    def __init__(self, source: Diagnoser | LearnedPolicy, **constants: Any):
        super().__init__()
        self.source = source
        for name, values in constants.items():
            self.register_buffer(name, torch.tensor(values, dtype=torch.float32))

    @property
    def tensors(self) -> dict[str, np.ndarray]:
        """What has been learnt, by name."""
        return self.source.tensors()

    @property
    def notes(self) -> dict[str, Any]:
        """What the file says of its answers besides."""
        return {
            "diagnoser": self.source.name,
            "classes": self.source.classes,
            **self.source.settings(),
        }

    @abstractmethod
    def episode(self, seed: int) -> dict[str, np.ndarray]:
        """The inputs, (n_samples, n_lanes, n_columns) float32, of one vehicle in an episode."""


class Watching(Graph):
    """One that is fed sample by sample with what a vehicle reads."""

    @abstractmethod
    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The inputs, (n_samples, n_lanes, n_columns) float32, of observations (n_samples, n_lanes, n_channels)."""

    def episode(self, seed: int) -> dict[str, np.ndarray]:
        """The inputs, as of `feed`, of one vehicle in a minute during which a motor overheats."""
        stimulus = manoeuvres(seed, EXAMPLE_SAMPLES, 1)
        return self.feed(
            roll_out(Fleet(1), [seed], EXAMPLE_SAMPLES, stimulus, [EXAMPLE]).observations
        )


class RawGraph(Watching):
    """The whole of `RawNetwork`."""

    inputs = {"observation": tuple(CHANNELS)}
    about = "observation: the last sample; hold the last reading of a channel that is silent"

    def __init__(self, source: RawNetwork):
        severity = same_severity((1, len(source.classes)), *PRIOR_SEVERITY)
        super().__init__(
            source, scale=SCALE, log_shares=_log(source.shares), severity=np.array(severity)
        )
        self.network = source.network

    def forward(self, observation: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """The belief."""
        port, starboard = (
            self.network(_chosen(observation, [*side, SPEED]) / self.scale) for side in COLUMNS
        )
        log_modes = torch.log_softmax(_chosen(port, PORT) + _chosen(starboard, STARBOARD), dim=1)
        log_probability = _pooled(log_modes, self.log_shares)
        return log_probability, *(moment.expand_as(log_probability) for moment in self.severity)

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The observations."""
        return {"observation": observations.astype(np.float32)}


class KalmanGraph(Watching):
    """`KalmanNetwork` behind its filter."""

    inputs = {"estimate": PARAMETERS[:2]}
    about = "estimate: alpha and beta, relative to nominal, of diagnosers.kalman.ParameterFilter after the last sample"

    def __init__(self, source: KalmanNetwork):
        super().__init__(
            source,
            nominal=NOMINAL,
            slope=source.learnt["slope"],
            offset=source.learnt["offset"],
            weights=SEVERITY_WEIGHTS,
            severity=source.severity.T,
            log_shares=_log(source.shares),
        )
        self.network = source.network

    def forward(self, estimate: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """The belief."""
        sums = self.network((estimate * self.nominal).clamp(0.0, 1.0))
        log_modes = torch.log_softmax(self.slope * sums + self.offset, dim=1)
        intercept, slope, std = self.severity
        mean = (
            intercept + slope * (torch.sigmoid(sums) * self.weights).sum(dim=1, keepdim=True)
        ).clamp(0.0, 1.0)
        return _pooled(log_modes, self.log_shares), mean, std.expand_as(mean)

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """What the filter estimates."""
        estimate = self.source.filter.initial(observations.shape[1])
        found = []
        columns = [self.source.filter.states.index(name) for name in self.inputs["estimate"]]
        for observation in observations:
            estimate = self.source.filter.update(estimate, observation)
            found.append(estimate.mean[:, columns].astype(np.float32))
        return {"estimate": np.stack(found)}


class ParallelGraph(Watching):
    """`Parallel` behind its filter."""

    inputs = RawGraph.inputs | KalmanGraph.inputs
    about = f"{RawGraph.about}; {KalmanGraph.about}"

    def __init__(self, source: Parallel):
        super().__init__(
            source, log_prior=source.log_prior, log_ratios=_log(np.array(source.ratios))
        )
        self.raw = RawGraph(source.raw)
        self.kalman = KalmanGraph(source.kalman)

    def forward(
        self, observation: torch.Tensor, estimate: torch.Tensor
    ) -> tuple[torch.Tensor, ...]:
        """The belief."""
        (shaft, *_) = self.raw(observation)
        (hull, *severity) = self.kalman(estimate)
        evidence = [
            _pooled(log, ratios) for log, ratios in zip((shaft, hull), self.log_ratios, strict=True)
        ]
        return torch.log_softmax(self.log_prior + evidence[0] + evidence[1], dim=1), *severity

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The observations, and what the filter estimates."""
        return self.raw.feed(observations) | self.kalman.feed(observations)


class OneSample(nn.GRUCell):
    """A gated recurrent unit as `Network` calls it, for one sample: PyTorch exports `nn.GRU` as a loop."""

    def forward(
        self, inputs: torch.Tensor, units: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """What it recalls, which is its units, and these."""
        units = super().forward(inputs, units)
        return units, units


class IntegratedGraph(Watching):
    """`Integrated` behind its features; state: units, calm opinion, steady odds and faults, and 1 once begun."""

    inputs = {"features": FEATURES}
    about = "features: of diagnosers.networks.features.Features after the last sample"
    widths = (N_MEMORY, N_OUTPUTS, 1, N_CLASSES - 1, 1)
    n_state = sum(widths)
    outputs = (*Belief._fields, "next_state")

    def __init__(self, source: Integrated):
        super().__init__(source, fault=[0.0] + [1.0] * (N_CLASSES - 1))
        tensors = {
            name.removesuffix("_l0"): torch.from_numpy(tensor)
            for name, tensor in source.tensors().items()
        }
        self.network = Network(OneSample)
        self.network.load_state_dict(tensors)

    def forward(self, features: torch.Tensor, state: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """The belief and the next state."""
        units, before, *steady, begun = state.split(self.widths, dim=1)
        encoded, opinion = self.network.encode(features)
        opinion = torch.where(begun > 0.0, smooth_opinion(opinion, before), opinion)
        outputs, units = self.network.recur(encoded, opinion, units)
        told, mean, std = self.network.decode(outputs, features)
        odds, faults = _steadied(told, *steady, begun > 0.0)
        faulty = torch.log_softmax(faults, dim=1) - softplus(-odds)
        following = torch.cat([units, opinion, odds, faults, torch.ones_like(begun)], dim=1)
        return (
            torch.cat([-softplus(odds), faulty], dim=1),
            mean * self.fault,
            std * self.fault,
            following,
        )

    def feed(self, observations: np.ndarray) -> dict[str, np.ndarray]:
        """The features."""
        features = Features(self.source.vehicle)
        found = []
        state = features.initial(observations.shape[1])
        for observation in observations.astype(np.float64):
            state, values = features.step(state, observation)
            found.append(values)
        return {"features": np.stack(found)}


class PolicyGraph(Graph):
    """The whole of `LearnedPolicy`."""

    inputs = {"features": policy_inputs.FEATURES}
    outputs = ("action",)
    about = (
        "features: of training.stimuli.policy_inputs, at every sample; the commanded speed is then the mission's plus "
        "the action times `amplitude` [m/s]"
    )

    def __init__(self, source: LearnedPolicy):
        super().__init__(source, **source.tensors)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """The action."""
        for layer in LAYERS:
            features = torch.tanh(
                linear(features, *(getattr(self, f"{layer}_{part}") for part in ("weight", "bias")))
            )
        return features

    @property
    def tensors(self) -> dict[str, np.ndarray]:
        """What has been learnt, by name."""
        return self.source.tensors

    @property
    def notes(self) -> dict[str, Any]:
        """What the policy was trained for."""
        return {name: getattr(self.source, name) for name in ("diagnoser", "budget", "amplitude")}

    def episode(self, seed: int) -> dict[str, np.ndarray]:
        """The features (n_decisions, 1, n_features) of one vehicle that follows the policy, one decision per second."""
        env = ActiveDiagnosisVectorEnv(diagnoser=self.source.diagnoser, budget=self.source.budget)
        found = []
        features, _ = env.reset(seed=seed)
        for _ in range(EXAMPLE_DECISIONS):
            found.append(features)
            features, *_ = env.step(self.source.action(features))
        env.close()
        return {"features": np.stack(found)}


GRAPHS: dict[str, type[Graph]] = {
    "raw_network": RawGraph,
    "kalman_network": KalmanGraph,
    "parallel": ParallelGraph,
    "integrated": IntegratedGraph,
}


def _chosen(values: torch.Tensor, columns: list[int]) -> torch.Tensor:
    """Some columns; plain indices would become a chain of transpositions in the file."""
    return values.index_select(1, torch.tensor(columns))


def _log(shares: np.ndarray) -> np.ndarray:
    """Logarithm of shares of which some are zero."""
    return np.log(shares, out=np.full(shares.shape, IMPOSSIBLE), where=shares > 0.0)


def _pooled(log_parts: torch.Tensor, log_shares: torch.Tensor) -> torch.Tensor:
    """Logarithm of parts times shares, (n_lanes, n_classes), from those of both."""
    return torch.logsumexp(log_parts[:, :, None] + log_shares, dim=1)


def _steadied(
    told: torch.Tensor, odds: torch.Tensor, faults: torch.Tensor, begun: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """`Steady.after`, with the logarithm of the averaged fault probabilities."""
    now = torch.logsumexp(told[:, 1:], dim=1, keepdim=True) - told[:, :1]
    odds = torch.where(
        begun, torch.maximum(now, odds + update_share(ODDS_SMOOTHING) * (now - odds)), now
    )
    share = update_share(FAULT_SMOOTHING)
    added = told[:, 1:] + float(np.log(share))
    kept = faults + float(np.log1p(-share))
    averaged = torch.maximum(added, kept) + softplus(-(added - kept).abs())
    return odds, torch.where(begun, averaged, added)
