"""The counter-based noise: its functions against libm, its draws against the distributions they
claim.
"""

import math

import numpy as np
import pytest
from scipy import stats

from auv_fault_env import layout, noise
from auv_fault_env.lanes import sample_normals

N_STEPS = 1600
N_NORMALS = 10


@pytest.fixture(scope="module")
def draws():
    """Normals (n_steps, 10 channels, 64 lanes) of neighbouring keys and consecutive steps: a
    million.
    """
    scratch = np.zeros(layout.N_SCRATCH * layout.LANES)
    key = np.arange(1, layout.LANES + 1, dtype=np.uint64)
    out = []
    for step in range(N_STEPS):
        sample_normals(scratch, layout.LANES, key, np.full(layout.LANES, step))
        rows = slice(layout.NORMAL, layout.NORMAL + N_NORMALS)
        out.append(scratch.reshape(-1, layout.LANES)[rows].copy())
    return np.array(out)


def correlation(a, b):
    """Correlation in units of its standard deviation under independence."""
    return np.corrcoef(a.ravel(), b.ravel())[0, 1] * math.sqrt(a.size)


def test_moments_and_distribution_of_the_normals(draws):
    n = draws.size
    assert n > 1e6 and draws.shape[1] == N_NORMALS
    assert abs(draws.mean()) < 4 / math.sqrt(n)
    assert abs(draws.var() - 1) < 4 * math.sqrt(2 / n)
    assert abs(stats.skew(draws, axis=None)) < 4 * math.sqrt(6 / n)
    assert abs(stats.kurtosis(draws, axis=None)) < 4 * math.sqrt(24 / n)
    assert stats.kstest(draws.ravel(), "norm").pvalue > 1e-3
    assert np.abs(draws).max() < 6.8


def test_every_channel_is_normal(draws):
    pvalues = [stats.kstest(draws[:, c].ravel(), "norm").pvalue for c in range(N_NORMALS)]
    assert min(pvalues) > 1e-3 / N_NORMALS


def test_channels_are_independent(draws):
    pairs = [(a, b) for a in range(N_NORMALS) for b in range(a)]
    for power in (1, 2):  # of one pair of Box and Muller the squares would betray a shared radius
        worst = max(abs(correlation(draws[:, a] ** power, draws[:, b] ** power)) for a, b in pairs)
        assert worst < 5.0


@pytest.mark.parametrize("lag", [1, 2, 3, 16])
def test_steps_and_neighbouring_keys_are_independent(draws, lag):
    for power in (1, 2):
        powers = draws**power
        assert abs(correlation(powers[lag:], powers[:-lag])) < 4.5
        assert abs(correlation(powers[:, :, lag:], powers[:, :, :-lag])) < 4.5


def test_channel_of_one_step_is_not_another_channel_of_the_next(draws):
    for a in range(N_NORMALS):
        for b in range(N_NORMALS):
            assert abs(correlation(draws[1:, a], draws[:-1, b])) < 5.0


def test_logarithm():
    rng = np.random.default_rng(0)
    values = np.concatenate(
        [2.0 ** rng.uniform(-1020, 1020, 3000), rng.uniform(0, 2, 3000), [1.0, 2.0**-33, 2.0**0.5]]
    )
    assert (
        max(abs(noise.logarithm(x) - math.log(x)) / max(1.0, abs(math.log(x))) for x in values)
        < 1e-9
    )


def test_sine_of_turns():
    turns = np.linspace(-0.25, 0.25, 5001)
    assert max(abs(noise.sine_of_turns(x) - math.sin(2 * math.pi * x)) for x in turns) < 1e-11


def test_normal_pair_lies_on_the_circle_of_its_radius():
    for word in np.random.default_rng(1).integers(0, 2**64, 2000, dtype=np.uint64):
        one, two = noise.normal_pair(word)
        radius = math.sqrt(-2 * math.log((int(word >> np.uint64(32)) + 0.5) / 2**32))
        angle = 2 * math.pi * (int(word) % 2**32) / 2**32
        # cos(2 pi turn) up to the sign convention: |turn - 1/2| - 1/4 maps turn to -cos's quarter
        # wave
        assert math.hypot(one, two) == pytest.approx(radius, rel=1e-9)
        assert abs(one) == pytest.approx(abs(radius * math.cos(angle)), abs=1e-9)
        assert abs(two) == pytest.approx(abs(radius * math.sin(angle)), abs=1e-9)


def test_gates_are_uniform_and_independent_of_each_other():
    words = np.random.default_rng(2).integers(0, 2**64, 5000, dtype=np.uint64)
    gates = np.array(
        [
            [noise.channel_uniform(word, np.uint64(channel)) for channel in range(4)]
            for word in words
        ]
    )
    assert 0.0 <= gates.min() and gates.max() < 1.0
    assert stats.kstest(gates.ravel(), "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(gates.T) - np.eye(4)).max() * math.sqrt(len(words)) < 4.5


def test_uniforms_lie_strictly_within_zero_and_one():
    key = np.arange(20_000, dtype=np.uint64)
    u = noise.uniforms(key, 0, 50)
    assert u.shape == (20_000, 50) and u.min() > 0.0 and u.max() < 1.0
    assert stats.kstest(u.ravel(), "uniform").pvalue > 1e-3
    for purpose in (1, 2, 3):
        assert abs(correlation(u, noise.uniforms(key, purpose, 50))) < 4.5
    assert abs(correlation(u[1:], u[:-1])) < 4.5 and abs(correlation(u[:, 1:], u[:, :-1])) < 4.5


def test_uniforms_of_more_numbers_begin_with_those_of_fewer():
    key = np.arange(5, dtype=np.uint64)
    assert np.array_equal(noise.uniforms(key, 1, 3), noise.uniforms(key, 1, 9)[:, :3])


def test_episode_keys_are_distinct():
    seed, episode = (
        part.ravel().astype(np.uint64) for part in np.meshgrid(np.arange(2000), np.arange(200))
    )
    assert np.unique(noise.episode_keys(seed, episode)).size == seed.size
