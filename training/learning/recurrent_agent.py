"""The agent with a memory of its own, an LSTM, to be compared with the one that leaves memory to the filters."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.buffers import RecurrentRolloutBuffer
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.common.recurrent.type_aliases import RNNStates

from training.learning.agent import LOG_STD, Bounded
from training.learning.imitation import PASSES, Lessons, watched
from training.learning.imitation import RATE as IMITATION_RATE
from training.learning.integrated import one_thread
from training.learning.stimulus import (
    DISCOUNT,
    GLOBAL_SEEDS,
    LANES,
    LIMIT,
    RATE,
    ROLLOUT,
    SETTINGS,
    StimulusTrainer,
    seeded,
)
from training.seeds import SPAN, seeds
from training.stimuli.policy import HIDDEN
from training.stimuli.policy_inputs import FEATURES

WATCHED = 8  # lanes of a batch of the imitation, so that it takes as many steps as the other form's
TIME = FEATURES.index("time")


class RecurrentAgent(Bounded, RecurrentActorCriticPolicy):
    """Actor and critic of an LSTM and a hidden layer each."""

    def __init__(self, *arguments: Any, **settings: Any):
        super().__init__(*arguments, net_arch=[HIDDEN], lstm_hidden_size=HIDDEN, **settings)

    def meant(self, rollout: RecurrentRolloutBuffer) -> np.ndarray:
        """As `Agent.meant`, with what the memory was at each step."""
        parts = (
            rollout.observations,
            rollout.hidden_states_pi,
            rollout.cell_states_pi,
            rollout.episode_starts,
        )
        told = [
            self.predict(seen, (h, c), start, True)[0]
            for seen, h, c, start in zip(*parts, strict=True)
        ]
        return np.stack(told)[..., 0]


class RecurrentTrainer(StimulusTrainer):
    """`StimulusTrainer` with a `RecurrentAgent` under the recurrent PPO of sb3-contrib.

    It is there to be measured by `outcomes`: `policy` and `finish`, which would keep it, are not
    for it.
    """

    def _made(self) -> RecurrentPPO:
        return RecurrentPPO(
            RecurrentAgent, self.env, RATE, n_steps=ROLLOUT, device="cpu", **SETTINGS
        )

    def _imitate(self) -> None:
        self.env.seed(seeds("training", LANES, SPAN - LANES)[0])
        with one_thread(), seeded(self.seed % GLOBAL_SEEDS):
            lessons = Lessons(
                *(part.unflatten(0, (LIMIT, LANES)) for part in watched(self.env, LIMIT, DISCOUNT))
            )
            for _ in range(PASSES):
                for lanes in torch.randperm(LANES).split(WATCHED):
                    self._follow(Lessons(*(part[:, lanes].swapaxes(0, 1) for part in lessons)))

    def _follow(self, lessons: Lessons) -> None:
        """A step of `training.learning.imitation.imitate` on whole episodes, (n_lanes, n_decisions) of each part."""
        still = torch.zeros(1, len(lessons.seen), HIDDEN)
        starts = (lessons.seen[..., TIME] == 0).float().flatten()
        seen, done, worth = (part.flatten(0, 1) for part in lessons)
        values, likely, _ = self.model.policy.evaluate_actions(
            seen, done, RNNStates((still, still), (still, still)), starts
        )
        # mean squared error of the action, and a constant
        squares = -2.0 * np.exp(2.0 * LOG_STD) * likely.mean()
        loss = squares + 0.1 * torch.nn.functional.mse_loss(values[:, 0], worth)
        self.learner.descend(loss, IMITATION_RATE)

    def _actor(self) -> Callable[[np.ndarray], np.ndarray]:
        state = None

        def act(observation: np.ndarray) -> np.ndarray:
            nonlocal state
            action, state = self.model.policy.predict(observation, state, deterministic=True)
            return action

        return act
