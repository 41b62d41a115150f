"""The thesis' way of training: one hidden layer, sigmoids, squared error, one sample at a time, gradient with momentum.

Every network of a study is a lane of one compiled loop, whatever its seed, size, setting or data.
Networks of one seed see the same stream of presentations and start from the same weights, of which
a smaller one takes the first rows.

Source: thesis V.C.2 (training set, random selection, backpropagation). Learning rate, momentum and
initial weights are not in it. Rumelhart, Hinton & Williams, "Learning representations by
back-propagating errors", Nature 323, 1986.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from auv_fault_env.compiling import kernel, scalar

# E: a small study of the training rms alone, see `raw_network_page.settings_section`
RATE = 0.5
MOMENTUM = 0.4
SPREAD = 0.3  # E: initial weights and biases are uniform within it
CHUNK = 10_000  # presentations drawn at once


class Lane(NamedTuple):
    """One network of a study: its seed, hidden nodes, learning rate, momentum, and which of the data sets it sees."""

    seed: int
    hidden: int
    rate: float = RATE
    momentum: float = MOMENTUM
    data: int = 0


class Networks(NamedTuple):
    """Weights of many networks, each padded to the widest; the last column of a layer is the bias.

    hidden (n_lanes, widest, n_inputs + 1), output (n_lanes, n_outputs, widest + 1), with zeros
    where a smaller network has no node; size (n_lanes,), hidden nodes.
    """

    hidden: np.ndarray
    output: np.ndarray
    size: np.ndarray


def initial(lanes: Sequence[Lane], n_inputs: int, n_outputs: int) -> Networks:
    """Untrained networks, uniform within ± `SPREAD`."""
    size = np.array([lane.hidden for lane in lanes])
    hidden = np.zeros((len(lanes), size.max(), n_inputs + 1))
    output = np.zeros((len(lanes), n_outputs, size.max() + 1))
    for lane, first, second in zip(lanes, hidden, output, strict=True):
        random = np.random.default_rng([lane.seed, 0])
        second[:, -1] = random.uniform(-SPREAD, SPREAD, n_outputs)
        nodes = random.uniform(-SPREAD, SPREAD, (lane.hidden, n_inputs + 1 + n_outputs))
        first[: lane.hidden] = nodes[:, : n_inputs + 1]
        second[:, : lane.hidden] = nodes[:, n_inputs + 1 :].T
    return Networks(hidden, output, size)


def train(
    groups: Mapping[Hashable, Sequence[Lane]],
    inputs: np.ndarray,
    targets: np.ndarray,
    checkpoints: Sequence[int],
    bar: tqdm,
) -> dict[Hashable, Networks]:
    """Train the networks of all groups together; by group, what they were after each number of presentations.

    Parameters
    ----------
    groups
        The networks, by the name of the group that is looked at together.
    inputs
        (n_sets, n_points, n_inputs), scaled to about [0, 1].
    targets
        (n_points, n_outputs), in [0, 1].
    checkpoints
        Ascending numbers of presentations; the weights returned have one more axis, in front, for
        them.
    bar
        Progress, by presentations of all networks at once.
    """
    lanes = [lane for group in groups.values() for lane in group]
    networks = initial(lanes, inputs.shape[-1], targets.shape[-1])
    kept = []
    for _ in _presented(lanes, networks, inputs, targets, checkpoints, bar):
        kept.append((networks.hidden.copy(), networks.output.copy()))
    hidden, output = (np.stack(weights) for weights in zip(*kept, strict=True))
    ends = np.cumsum([len(group) for group in groups.values()])
    slices = [
        slice(end - len(group), end) for end, group in zip(ends, groups.values(), strict=True)
    ]
    parts = [Networks(hidden[:, part], output[:, part], networks.size[part]) for part in slices]
    return dict(zip(groups, parts, strict=True))


def _presented(
    lanes: Sequence[Lane],
    networks: Networks,
    inputs: np.ndarray,
    targets: np.ndarray,
    checkpoints: Sequence[int],
    bar: tqdm,
) -> Iterator[int]:
    """Train in place and stop at every checkpoint."""
    steps = np.zeros_like(networks.hidden), np.zeros_like(networks.output)
    seeds = sorted({lane.seed for lane in lanes})
    streams = [np.random.default_rng([seed, 1]) for seed in seeds]
    stream = np.array([seeds.index(lane.seed) for lane in lanes])
    data = np.array([lane.data for lane in lanes])
    rate = np.array([lane.rate for lane in lanes])
    momentum = np.array([lane.momentum for lane in lanes])
    done = 0
    for checkpoint in checkpoints:
        while done < checkpoint:
            count = min(CHUNK, checkpoint - done)
            order = np.stack([random.integers(len(targets), size=count) for random in streams])
            _train(*networks, *steps, inputs, targets, order, stream, data, rate, momentum)
            done += count
            bar.update(count)
        yield done


@kernel
def _train(
    hidden,
    output,
    size,
    hidden_step,
    output_step,
    inputs,
    targets,
    order,
    stream,
    data,
    rate,
    momentum,
):
    """Present the samples in order (n_streams, count) to every lane, which changes weights and last steps in place."""
    activity = np.empty(hidden.shape[1])
    error = np.empty(output.shape[1])
    for lane in range(len(size)):
        n = size[lane]
        samples = inputs[data[lane]]
        for sample in order[stream[lane]]:
            _present(
                hidden[lane], output[lane], n, samples[sample], targets[sample], activity, error
            )
            _learn(hidden[lane], output[lane], n, samples[sample], activity, error,
                   hidden_step[lane], output_step[lane], rate[lane], momentum[lane])  # fmt: skip


@scalar
def _sigmoid(x):
    """The logistic function."""
    return 1.0 / (1.0 + np.exp(-x))


@scalar
def _present(hidden, output, size, sample, target, activity, error):
    """Activities of the hidden nodes, and minus the gradient of half the squared error by the outputs' inputs."""
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
def _learn(hidden, output, size, sample, activity, error, hidden_step, output_step, rate, momentum):
    """One step of gradient descent with momentum; the hidden layer's error uses the output weights before the step."""
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


def recall(networks: Networks, inputs: np.ndarray) -> np.ndarray:
    """Outputs (..., n_lanes, n_points, n_outputs) for inputs (n_points, n_inputs), or such for every lane."""
    activity = _layer(networks.hidden, inputs)
    return _layer(networks.output, activity)


def _layer(weights: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    return 1.0 / (
        1.0 + np.exp(-(inputs @ weights[..., :-1].swapaxes(-1, -2) + weights[..., None, :, -1]))
    )


def rms(outputs: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Root mean squared error over points and outputs, (..., n_lanes)."""
    return np.sqrt(((outputs - targets) ** 2).mean(axis=(-2, -1)))
