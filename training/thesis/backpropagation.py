"""The thesis' way of training: one hidden layer, sigmoids, squared error, one sample at a time.

All networks of a study are trained in one compiled loop, whatever their seed, size, settings or
data. Networks of one seed see the same stream of presentations and start from the same weights, of
which a smaller one takes the first rows.

Source: thesis V.C.2 (training set, random selection, backpropagation). Learning rate, momentum and
initial weights are not in it. Rumelhart, Hinton & Williams, "Learning representations by
back-propagating errors", Nature 323, 1986.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.compiling import kernel, scalar

# E: a small study of the training rms alone, see `raw_page.settings_section`
LEARNING_RATE = 0.5
MOMENTUM = 0.4
INITIAL_RANGE = 0.3  # E: initial weights and biases are uniform within it
PRESENTATIONS_PER_CALL = 10_000


class NetworkSettings(NamedTuple):
    """How one network of a study is trained; `data_set` is the index of the inputs that it sees."""

    seed: int
    n_hidden: int
    learning_rate: float = LEARNING_RATE
    momentum: float = MOMENTUM
    data_set: int = 0


class Networks(NamedTuple):
    """Weights of many networks, padded to the widest; the last column of a layer is the bias.

    `hidden` is (n_networks, widest, n_inputs + 1), `output` (n_networks, n_outputs, widest + 1);
    both are zero where a smaller network has no node.
    """

    hidden: np.ndarray
    output: np.ndarray
    n_hidden: np.ndarray


def initial_networks(
    settings: Sequence[NetworkSettings], n_inputs: int, n_outputs: int
) -> Networks:
    """Untrained networks, uniform within ± `INITIAL_RANGE`."""
    n_hidden = np.array([network.n_hidden for network in settings])
    hidden = np.zeros((len(settings), n_hidden.max(), n_inputs + 1))
    output = np.zeros((len(settings), n_outputs, n_hidden.max() + 1))
    for k, network in enumerate(settings):
        random = np.random.default_rng([network.seed, 0])
        output[k, :, -1] = random.uniform(-INITIAL_RANGE, INITIAL_RANGE, n_outputs)
        shape = (network.n_hidden, n_inputs + 1 + n_outputs)
        nodes = random.uniform(-INITIAL_RANGE, INITIAL_RANGE, shape)
        hidden[k, : network.n_hidden] = nodes[:, : n_inputs + 1]
        output[k, :, : network.n_hidden] = nodes[:, n_inputs + 1 :].T
    return Networks(hidden, output, n_hidden)


def train(
    groups: Mapping[Hashable, Sequence[NetworkSettings]],
    inputs: np.ndarray,
    targets: np.ndarray,
    checkpoints: Sequence[int],
    bar: tqdm,
) -> dict[Hashable, Networks]:
    """Train the networks of all groups together; the first axis of the weights is the checkpoint.

    Parameters
    ----------
    inputs
        (n_sets, n_points, n_inputs), scaled to about [0, 1].
    targets
        (n_points, n_outputs), in [0, 1].
    checkpoints
        Ascending numbers of presentations after which the weights are recorded.
    """
    settings = [network for group in groups.values() for network in group]
    networks = initial_networks(settings, inputs.shape[-1], targets.shape[-1])
    hidden = []
    output = []
    for _ in _train_to_checkpoints(settings, networks, inputs, targets, checkpoints, bar):
        hidden.append(networks.hidden.copy())
        output.append(networks.output.copy())
    hidden = np.stack(hidden)
    output = np.stack(output)
    trained = {}
    start = 0
    for name, group in groups.items():
        members = slice(start, start + len(group))
        weights = (hidden[:, members], output[:, members])
        trained[name] = Networks(*weights, networks.n_hidden[members])
        start += len(group)
    return trained


def _train_to_checkpoints(
    settings: Sequence[NetworkSettings],
    networks: Networks,
    inputs: np.ndarray,
    targets: np.ndarray,
    checkpoints: Sequence[int],
    bar: tqdm,
) -> Iterator[int]:
    """Train in place and yield at every checkpoint."""
    last_steps = (np.zeros_like(networks.hidden), np.zeros_like(networks.output))
    seeds = sorted({network.seed for network in settings})
    streams = [np.random.default_rng([seed, 1]) for seed in seeds]
    stream = np.array([seeds.index(network.seed) for network in settings])
    data_set = np.array([network.data_set for network in settings])
    rate = np.array([network.learning_rate for network in settings])
    momentum = np.array([network.momentum for network in settings])
    done = 0
    for checkpoint in checkpoints:
        while done < checkpoint:
            count = min(PRESENTATIONS_PER_CALL, checkpoint - done)
            order = np.stack([random.integers(len(targets), size=count) for random in streams])
            _train(
                *networks,
                *last_steps,
                inputs,
                targets,
                order,
                stream,
                data_set,
                rate,
                momentum,
            )
            done += count
            bar.update(count)
        yield done


@kernel
def _train(
    hidden,
    output,
    n_hidden,
    hidden_step,
    output_step,
    inputs,
    targets,
    order,
    stream,
    data_set,
    rate,
    momentum,
):
    """Present the samples in their order (n_streams, count) to every network, in place."""
    activity = np.empty(hidden.shape[1])
    error = np.empty(output.shape[1])
    for k in range(len(n_hidden)):
        n = n_hidden[k]
        samples = inputs[data_set[k]]
        for sample in order[stream[k]]:
            _present(
                hidden[k],
                output[k],
                n,
                samples[sample],
                targets[sample],
                activity,
                error,
            )
            _learn(hidden[k], output[k], n, samples[sample], activity, error,
                   hidden_step[k], output_step[k], rate[k], momentum[k])  # fmt: skip


@scalar
def _sigmoid(x):
    """The logistic function."""
    return 1.0 / (1.0 + np.exp(-x))


@scalar
def _present(hidden, output, size, sample, target, activity, error):
    """Activities of the hidden nodes, and minus the gradient of half the squared error."""
    n_inputs = len(sample)
    bias = output.shape[1] - 1
    for j in range(size):
        total = hidden[j, n_inputs]
        for i in range(n_inputs):
            total += hidden[j, i] * sample[i]
        activity[j] = _sigmoid(total)
    for k in range(len(target)):
        total = output[k, bias]
        for j in range(size):
            total += output[k, j] * activity[j]
        y = _sigmoid(total)
        error[k] = (target[k] - y) * y * (1.0 - y)


@scalar
def _learn(
    hidden,
    output,
    size,
    sample,
    activity,
    error,
    hidden_step,
    output_step,
    rate,
    momentum,
):
    """One step of gradient descent with momentum, the hidden layer first."""
    n_inputs = len(sample)
    bias = output.shape[1] - 1
    for j in range(size):
        back = 0.0
        for k in range(len(error)):
            back += error[k] * output[k, j]
        back *= rate * activity[j] * (1.0 - activity[j])
        for i in range(n_inputs):
            hidden_step[j, i] = back * sample[i] + momentum * hidden_step[j, i]
            hidden[j, i] += hidden_step[j, i]
        hidden_step[j, n_inputs] = back + momentum * hidden_step[j, n_inputs]
        hidden[j, n_inputs] += hidden_step[j, n_inputs]
    for k in range(len(error)):
        for j in range(size):
            output_step[k, j] = rate * error[k] * activity[j] + momentum * output_step[k, j]
            output[k, j] += output_step[k, j]
        output_step[k, bias] = rate * error[k] + momentum * output_step[k, bias]
        output[k, bias] += output_step[k, bias]


def evaluate(networks: Networks, inputs: np.ndarray) -> np.ndarray:
    """Outputs of the networks, (..., n_networks, n_points, n_outputs).

    Inputs are (n_points, n_inputs) for all networks, or (n_networks, n_points, n_inputs).
    """
    activity = _layer(networks.hidden, inputs)
    return _layer(networks.output, activity)


def _layer(weights: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    bias = weights[..., None, :, -1]
    total = inputs @ weights[..., :-1].swapaxes(-1, -2) + bias
    return 1.0 / (1.0 + np.exp(-total))


def rms_error(outputs: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Root mean squared error over points and outputs, (..., n_networks)."""
    return np.sqrt(((outputs - targets) ** 2).mean(axis=(-2, -1)))
