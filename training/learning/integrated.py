"""Trains the integrated network (VI.B): a recurrent network on readings, residuals and filter estimates."""

import re
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import chain, islice
from math import cos, pi
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn

from auv_fault_env.faults import classes
from auv_fault_env.parameters import PRESETS
from auv_fault_env.schedules import ScheduleSampler
from diagnosers.integrated import Integrated, smooth_opinion
from diagnosers.networks.features import Features, feature_names
from diagnosers.networks.integrated_network import Network
from training.learning.adam import AdamTraining
from training.learning.episodes import training_episodes
from training.learning.reproducible import one_thread
from training.rollouts import Rollout
from training.seeds import SPAN

# faults stay; after a repair, reset
SCHEDULES = ScheduleSampler(compound=0.05, intermittent=0.05, repaired=0.0)
LANES = 512  # episodes simulated together
LESSONS = 4  # such simulations per epoch
# simulations at a time, and ahead of their use: the filter bank takes more time than all else
SIMULATORS = 2
AHEAD = 4
# epochs whose lessons the encoder looks back on, and at which of their samples
KEPT = 6
KEPT_EVERY = 6
GLANCES = 150  # steps of the encoder per lesson
# lessons drawn for such a step, and samples of each
MIXED = 8
GLANCED = 256
BATCH = 32  # episodes per step of the memory
LOOKING = 6  # epochs in which the encoder learns alone
RATE = 1e-3  # of Adam at the highest
MEMORY_RATE = 2e-3  # they fall to zero as a cosine over all epochs
SEVERITY_WEIGHT = 0.1  # of the severity's likelihood beside the cross-entropy
TRIED = 2  # lessons to validate and to calibrate on
LEAN = 0.4  # on the bank, in the pool of both; chosen on calibration lanes
CALIBRATED_EVERY = 10  # samples: neighbours tell the same


class Lesson(NamedTuple):
    """Episodes as the network sees them: features (n_samples, n_lanes, n_features), label and severity likewise."""

    features: torch.Tensor
    label: torch.Tensor
    severity: torch.Tensor


class IntegratedTrainer:
    """Cross-entropy of the class plus Gaussian likelihood of the severity, on every sample of streamed episodes.

    The encoder learns from samples drawn at random out of many episodes, in many small steps
    (samples of few episodes are too much alike: it would learn these by heart); the memory from
    whole episodes of what the encoder makes of them. Half of all episodes are learnt from as mirror
    images, port and starboard exchanged.
    """

    epochs = 20
    patience = 20
    data = (
        f"training: {LESSONS * LANES} episodes of 60 s an epoch, half of them mirrored, half with the thesis' "
        "stimulus, half with random missions and manoeuvres; single, compound, incipient and intermittent "
        "faults and healthy vehicles, default band, noise and disturbance; validated and calibrated on "
        f"{TRIED * LANES} such episodes each, with seeds of their own"
    )

    def __init__(self, seed: int) -> None:
        self.seed = seed
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            self.learner = AdamTraining(Network(classes=classes()))
        self.network = self.learner.network
        self.validation: list[Lesson] = []
        self.kept: deque[Lesson] = deque(maxlen=KEPT * LESSONS)
        self.next_epoch = -1
        self.stream = iter(())

    def epoch(self, number: int) -> dict[str, float]:
        """Train on episodes that depend on (seed, number) alone; the next are simulated while these are learnt from."""
        random = np.random.default_rng([self.seed, number, 1])
        glances = []
        episodes = []
        if not self.kept:
            self._look_back(number)
        with one_thread():
            for k, taught in enumerate(self._lessons(number)):
                fall = 0.5 * (1.0 + cos(pi * min((number + k / LESSONS) / self.epochs, 1.0)))
                self.kept.append(sampled(taught, k))
                glances += self.glance(RATE * fall, random)
                if number >= LOOKING:
                    episodes += self.remember(taught, MEMORY_RATE * fall)
        return {"loss": float(np.mean(episodes or glances)), "glance_loss": float(np.mean(glances))}

    def _lessons(self, number: int) -> Iterator[Lesson]:
        """The lessons of an epoch, from a stream that goes on over all epochs."""
        if number != self.next_epoch:
            firsts = chain.from_iterable(map(self._firsts, range(number, self.epochs)))
            self.stream = simulated("training", firsts)
        self.next_epoch = number + 1
        return islice(self.stream, LESSONS)

    def _firsts(self, number: int) -> list[int]:
        """First seeds of the lessons of an epoch."""
        return (
            np.random.default_rng([self.seed, number]).integers(SPAN - LANES, size=LESSONS).tolist()
        )

    def _look_back(self, number: int) -> None:
        """Simulate again what a training that goes on from here had kept."""
        for earlier in range(max(0, number - KEPT), number):
            taught = enumerate(simulated("training", self._firsts(earlier)))
            self.kept.extend(sampled(one, k) for k, one in taught)

    def glance(self, rate: float, random: np.random.Generator) -> list[float]:
        """Steps of the encoder, each on samples drawn at random from lessons drawn at random; their losses."""
        losses = []
        for k in range(GLANCES):
            chosen = [self.kept[place] for place in random.integers(len(self.kept), size=MIXED)]
            places = [
                torch.from_numpy(random.integers(len(one.label), size=GLANCED)) for one in chosen
            ]
            parts = zip(
                *(tuple(part[at] for part in one) for one, at in zip(chosen, places, strict=True)),
                strict=True,
            )
            features, label, severity = (torch.cat(part) for part in parts)
            seen = mirrored_if(k % 2, Lesson(features.float(), label, severity))
            losses.append(self._descend(self.network.encode(seen.features)[1], seen, rate))
        return losses

    def remember(self, taught: Lesson, rate: float) -> list[float]:
        """Steps of the memory, each on a batch of whole episodes; their losses."""
        return [
            self._descend(self.outputs(seen), seen, rate)
            for k, batch in enumerate(batches(taught))
            for seen in [mirrored_if(k % 2, batch)]
        ]

    def _descend(self, outputs: torch.Tensor, taught: Lesson, rate: float) -> float:
        loss, severity_loss = self.losses(outputs, taught)
        self.learner.step(loss + SEVERITY_WEIGHT * severity_loss, rate)
        return loss.item()

    def outputs(self, taught: Lesson) -> torch.Tensor:
        """The network's outputs on whole episodes (n_samples, n_lanes, 3 n_classes); the encoder gets no gradient."""
        with torch.no_grad():
            encoded, opinions = self.network.encode(taught.features)
            for k in range(1, len(opinions)):
                opinions[k] = smooth_opinion(opinions[k], opinions[k - 1])
        return self.network.recur(encoded, opinions)[0]

    def losses(self, outputs: torch.Tensor, taught: Lesson) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean negative log-probability of the class, and of the severity where there is a fault."""
        log_probability, mean, std = self.network.decode(outputs, taught.features)
        label = taught.label[..., None]
        mean = mean.gather(-1, label)[..., 0]
        std = std.gather(-1, label)[..., 0]
        faulty = (taught.label > 0).float()
        severity_loss = 0.5 * ((taught.severity - mean) / std) ** 2 + std.log()
        class_loss = -log_probability.gather(-1, label).mean()
        return class_loss, (severity_loss * faulty).sum() / faulty.sum().clamp(min=1.0)

    def validate(self) -> dict[str, float]:
        """Both losses on the validation seeds."""
        self.validation = self.validation or list(simulated("validation", tried()))
        seen = [batch for taught in self.validation for batch in batches(taught)]
        with one_thread(), torch.no_grad():
            losses = [tuple(map(float, self.losses(self.outputs(batch), batch))) for batch in seen]
        return dict(zip(("loss", "severity_loss"), np.mean(losses, axis=0).tolist(), strict=True))

    def state(self) -> dict[str, np.ndarray]:
        """Weights and moments of Adam, by name."""
        return self.learner.state()

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take over what `state` gave."""
        self.learner.restore(state)

    def finish(self) -> tuple[Integrated, dict[str, Any]]:
        """Calibrate, and give the diagnoser with its losses on the calibration seeds before and after."""
        network = self.network
        scores = []
        label = []
        network.lean.fill_(LEAN)
        with one_thread(), torch.no_grad():
            for taught in simulated("calibration", tried()):
                for batch in batches(taught):
                    pooled = network.pool_scores(self.outputs(batch), batch.features)
                    scores.append(pooled[::CALIBRATED_EVERY].flatten(0, 1))
                    label.append(batch.label[::CALIBRATED_EVERY].flatten())
        before, after = calibrate(network, torch.cat(scores), torch.cat(label))
        figures = {
            "calibration_loss_before": before,
            "calibration_loss": after,
            "sharpness": float(network.sharpness),
        }
        return Integrated(weights=network.tensors(), trained_classes=classes()), figures


def tried() -> list[int]:
    """First seeds of the lessons to validate or calibrate on."""
    return [k * LANES for k in range(TRIED)]


def simulated(purpose: str, firsts: Iterable[int]) -> Iterator[Lesson]:
    """A lesson of `LANES` episodes from each of these seeds of a purpose on, a few simulated ahead of their use."""
    pool = ThreadPoolExecutor(SIMULATORS)
    coming = iter(firsts)
    try:
        waiting = deque(pool.submit(lesson, purpose, first) for first in islice(coming, AHEAD))
        while waiting:
            ready = waiting.popleft().result()
            waiting.extend(pool.submit(lesson, purpose, first) for first in islice(coming, 1))
            yield ready
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def lesson(purpose: str, first: int) -> Lesson:
    """`LANES` episodes from the first-th seed of a purpose on, as the network sees them."""
    rollouts = list(training_episodes(purpose, LANES, first, SCHEDULES))
    parts = (
        [encoded(rollout) for rollout in rollouts],
        [r.label for r in rollouts],
        [r.severity for r in rollouts],
    )
    return Lesson(*(torch.from_numpy(np.concatenate(part, axis=1)) for part in parts))


def encoded(rollout: Rollout) -> np.ndarray:
    """The features of a rollout, (n_samples, n_lanes, n_features) float32."""
    encoder = Features(PRESETS["thesis1992"], classes())
    state = encoder.initial(rollout.label.shape[1])
    features = np.empty((*rollout.label.shape, encoder.n_features), np.float32)
    for k, observation in enumerate(rollout.observations.astype(np.float64)):
        state, features[k] = encoder.step(state, observation)
    return features


def sampled(taught: Lesson, turn: int) -> Lesson:
    """One sample in `KEPT_EVERY` of a lesson, lanes in a row, in half precision: what the encoder looks back on."""
    features, label, severity = (
        part[turn % KEPT_EVERY :: KEPT_EVERY].flatten(0, 1) for part in taught
    )
    return Lesson(features.half(), label.clone(), severity.clone())


def batches(taught: Lesson) -> Iterator[Lesson]:
    """The lesson in batches of `BATCH` lanes, each with thesis and random missions alike."""
    step = taught.label.shape[1] // BATCH
    for k in range(step):
        yield Lesson(*(part[:, k::step].contiguous() for part in taught))


@cache
def image(names: tuple[str, ...]) -> torch.Tensor:
    """For each name the place of its mirror image: port and starboard exchanged."""
    swap = {"port": "starboard", "starboard": "port"}
    mirrored_name = lambda name: re.sub("starboard|port", lambda side: swap[side[0]], name)  # noqa: E731
    return torch.tensor([names.index(mirrored_name(name)) for name in names])


def mirrored_if(turn: int, taught: Lesson) -> Lesson:
    """The lesson as it is, or (turn 1) on a vehicle with port and starboard exchanged."""
    if not turn:
        return taught
    names = classes()
    features = taught.features[..., image(feature_names(names))]
    return Lesson(features, image(names)[taught.label], taught.severity)


def calibrate(network: Network, scores: torch.Tensor, label: torch.Tensor) -> tuple[float, float]:
    """Fit sharpness and bias to scores (n, n_classes) of lanes not trained on; returns the losses before and after."""
    sharpness = torch.ones(1, requires_grad=True)
    bias = torch.zeros(scores.shape[1], requires_grad=True)
    optimiser = torch.optim.LBFGS([sharpness, bias], max_iter=100, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        value = nn.functional.cross_entropy(sharpness * scores + bias, label)
        value.backward()
        return value

    before = optimiser.step(loss).item()
    with torch.no_grad():
        network.sharpness.copy_(sharpness)
        network.bias.copy_(bias)
    return before, loss().item()
