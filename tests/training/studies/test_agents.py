"""The agent with a memory of its own, and its comparison with the published one."""

import json

import numpy as np
import pytest
import torch
from stable_baselines3.common.callbacks import BaseCallback

pytest.importorskip("sb3_contrib")


from training.learning import recurrent_agent, stimulus
from training.learning.imitation import watched
from training.learning.recurrent_agent import TIME, RecurrentTrainer
from training.stimuli.policy import HIDDEN
from training.studies import agents

# decisions
N_LANES = 16
EPISODE = 12


class Compared(BaseCallback):
    """Keeps what an agent meant beside what it did."""

    def _on_step(self):
        return True

    def _on_rollout_end(self):
        rollout = self.model.rollout_buffer
        self.meant = self.model.policy.meant(rollout)
        self.done = rollout.actions[..., 0].copy()
        self.starts = rollout.episode_starts.copy()


@pytest.fixture(autouse=True)
def small(monkeypatch):
    for module in (stimulus, recurrent_agent):
        monkeypatch.setattr(module, "LANES", N_LANES)
        monkeypatch.setattr(module, "LIMIT", EPISODE)
    monkeypatch.setitem(stimulus.SETTINGS, "batch_size", 128)
    for name, value in {"TRIED": 8, "VALIDATED": 6, "ROLLOUTS": 1}.items():
        monkeypatch.setattr(stimulus, name, value)


def test_what_it_means_is_what_it_does_without_noise():
    trainer = RecurrentTrainer(0)
    seen = Compared()
    with torch.no_grad():
        trainer.model.policy.action_net[0].weight.mul_(100.0)
        trainer.model.policy.log_std.fill_(-12.0)
    trainer.env.seed(1)
    trainer.model.learn(1, seen, log_interval=None)
    assert seen.starts[0].all() and seen.starts[1:].any()
    assert np.std(seen.done) > 0.01
    np.testing.assert_allclose(seen.meant, seen.done, atol=1e-4)


def test_it_learns_from_the_rule_and_forgets_between_episodes():
    trainer = RecurrentTrainer(0)
    trainer.env.seed(1)
    lessons = watched(trainer.env, 2 * EPISODE, 0.9)
    seen = lessons.seen.unflatten(0, (2 * EPISODE, N_LANES))
    starts = (seen[..., TIME] == 0).float()
    assert starts[0].all() and starts[EPISODE].any() and starts.mean() < 0.3

    def meant(part):
        still = torch.zeros(1, N_LANES, HIDDEN)
        flat = (
            seen[part].swapaxes(0, 1).flatten(0, 1),
            (still, still),
            starts[part].swapaxes(0, 1).flatten(),
        )
        with torch.inference_mode():
            mean = trainer.model.policy.get_distribution(*flat)[0].distribution.mean
        return mean.unflatten(0, (N_LANES, -1))[..., 0].swapaxes(0, 1)

    def error():
        return float(
            (meant(slice(None)) - lessons.done.unflatten(0, (2 * EPISODE, N_LANES))[..., 0])
            .square()
            .mean()
        )

    before = error()
    trainer._imitate()
    assert error() < before
    late = starts[EPISODE].bool()
    torch.testing.assert_close(
        meant(slice(None))[EPISODE:, late], meant(slice(EPISODE, None))[:, late]
    )


def test_the_comparison_goes_into_the_card(tmp_path, monkeypatch, capsys):
    card = tmp_path / "card.json"
    card.write_text('{"seed": 0}', encoding="utf-8")
    monkeypatch.setattr(agents, "CARD", card)
    monkeypatch.setattr(agents, "SEEDS", 1)
    monkeypatch.setattr(agents, "STEPS", 1)
    monkeypatch.setattr(
        agents, "Parallel", lambda **_: lambda jobs: [f(*a, **k) for f, a, k in jobs]
    )
    agents.main()
    made = json.loads(card.read_text(encoding="utf-8"))
    rows = made["memory_forms"]["rows"]
    assert made["seed"] == 0 and [row["form"] for row in rows] == ["feed-forward", "LSTM"]
    assert rows[1]["parameters"] > 2 * rows[0]["parameters"]
    assert all(0.0 < row["delay"] <= 30.0 and row["seconds"] > 0.0 for row in rows)
    assert capsys.readouterr().out.count("healthy_rms") == 2
