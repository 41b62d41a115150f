import numpy as np
import pytest
import torch

from training.thesis.backpropagation import (
    NetworkSettings,
    evaluate,
    initial_networks,
    rms_error,
    train,
)


class Bar:
    """A progress bar that counts."""

    n = 0

    def update(self, count=1):
        self.n += count


def task(n_sets=2, n_points=30):
    random = np.random.default_rng(5)
    return random.uniform(size=(n_sets, n_points, 3)), random.uniform(size=(n_points, 2))


SETTINGS = [
    NetworkSettings(1, 4),
    NetworkSettings(1, 2, 0.9, 0.0, data_set=1),
    NetworkSettings(7, 3, 0.1, 0.9),
]


def by_autograd(network, inputs, targets, presentations):
    """The same training written with torch: autograd, SGD with momentum, one sample at a time."""
    start = initial_networks([network], inputs.shape[-1], targets.shape[-1])
    weights = [torch.tensor(layer[0], requires_grad=True) for layer in (start.hidden, start.output)]
    optimiser = torch.optim.SGD(weights, lr=network.learning_rate, momentum=network.momentum)
    x = torch.tensor(inputs[network.data_set])
    t = torch.tensor(targets)
    one = torch.ones(1, dtype=torch.float64)
    for sample in np.random.default_rng([network.seed, 1]).integers(
        len(targets), size=presentations
    ):
        optimiser.zero_grad()
        activity = torch.sigmoid(weights[0] @ torch.cat([x[sample], one]))
        output = torch.sigmoid(weights[1] @ torch.cat([activity, one]))
        (0.5 * ((t[sample] - output) ** 2).sum()).backward()
        optimiser.step()
    return [layer.detach().numpy() for layer in weights]


def test_training_is_what_autograd_does():
    inputs, targets = task()
    trained = train({"all": SETTINGS}, inputs, targets, (400,), Bar())["all"]
    for k, network in enumerate(SETTINGS):
        hidden, output = by_autograd(network, inputs, targets, 400)
        np.testing.assert_allclose(
            trained.hidden[0, k, : network.n_hidden], hidden, rtol=0, atol=1e-6
        )
        np.testing.assert_allclose(
            trained.output[0, k][:, [*range(network.n_hidden), -1]], output, rtol=0, atol=1e-6
        )


def test_a_network_is_the_same_alone_and_among_wider_ones():
    inputs, targets = task()
    together = train(
        {"first": SETTINGS[:1], "others": SETTINGS[1:]}, inputs, targets, (50,), Bar()
    )["others"]
    alone = train({"it": SETTINGS[1:2]}, inputs, targets, (50,), Bar())["it"]
    assert np.array_equal(evaluate(together, inputs[0])[0, 0], evaluate(alone, inputs[0])[0, 0])


def test_networks_of_one_seed_start_alike_and_those_of_others_do_not():
    wide, narrow, other = (
        initial_networks([NetworkSettings(seed, size)], 3, 2).hidden[0]
        for seed, size in ((1, 4), (1, 2), (2, 4))
    )
    assert wide.shape == (4, 4)
    assert np.abs(wide).max() <= 0.3
    assert not np.array_equal(wide, other)
    both = initial_networks([NetworkSettings(1, 4), NetworkSettings(1, 2)], 3, 2).hidden
    assert np.array_equal(both[1, :2], both[0, :2])
    assert np.all(both[1, 2:] == 0)
    assert narrow.shape == (2, 4)


def test_checkpoints_and_chunks_do_not_change_the_training():
    inputs, targets = task()
    bar = Bar()
    once = train({"it": SETTINGS[:1]}, inputs, targets, (10_050,), bar)["it"]
    often = train({"it": SETTINGS[:1]}, inputs, targets, (7, 9_000, 10_050), Bar())["it"]
    assert bar.n == 10_050
    assert often.hidden.shape[0] == 3
    assert np.array_equal(once.output[0], often.output[2])
    assert not np.array_equal(often.output[0], often.output[1])


def test_it_learns_a_boundary():
    points = np.stack(np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)), axis=-1).reshape(
        1, -1, 2
    )
    targets = np.eye(2)[(points[0].sum(axis=1) > 1.05).astype(int)]
    settings = [NetworkSettings(seed, 3) for seed in range(3)]
    trained = train({"it": settings}, points, targets, (1, 60_000), Bar())["it"]
    before, after = rms_error(evaluate(trained, points[0]), targets)
    assert np.all(before > 0.45)
    assert np.all(after < 0.1)


def test_outputs_and_rms_error_by_hand():
    networks = initial_networks([NetworkSettings(0, 1)], 1, 1)
    networks.hidden[0] = [[np.log(3.0), 0.0]]
    networks.output[0] = [[2.0, -1.5]]
    output = evaluate(networks, np.array([[0.0], [1.0]]))  # hidden node 0.5 and 0.75
    assert output.shape == (1, 2, 1)
    assert output[0, :, 0] == pytest.approx([1 / (1 + np.exp(0.5)), 0.5])
    assert rms_error(output, np.array([[output[0, 0, 0]], [0.1]])) == pytest.approx(
        [0.4 / np.sqrt(2)]
    )
