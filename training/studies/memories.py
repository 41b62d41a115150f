"""Which form the integrated network's memory should have: ``python -m training.studies.memories``.

Every form learns anew, behind the encoder of the weights in the package, from the same lessons, and
is tried on the same validation lessons. The table goes into the card beside the weights.
"""

import json
import sys
import time

import numpy as np
import torch
from torch import nn
from tqdm import tqdm

from diagnosers import storage
from diagnosers.integrated import PACKAGED
from training.learning.integrated import LANES, MEMORY_RATE, IntegratedTrainer, simulated, tried
from training.report.run_folder import write_json
from training.seeds import SPAN

CARD = PACKAGED.with_suffix(".json")
LESSONS = 6
SEED = 1  # that of the weights in the package is 0


class NoMemory(nn.Module):
    """A layer that sees the sample alone: feed-forward on features that remember by running means and filters."""

    def __init__(self, n_inputs: int, n_units: int):
        super().__init__()
        self.layer = nn.Linear(n_inputs, n_units)

    def forward(self, inputs: torch.Tensor, units: None = None) -> tuple[torch.Tensor, None]:
        """Units (n_samples, n_lanes, n_units), and nothing to carry on."""
        return torch.tanh(self.layer(inputs)), None


FORMS: dict[str, type[nn.Module]] = {
    "feed-forward": NoMemory,
    "Elman": nn.RNN,
    "GRU": nn.GRU,
    "LSTM": nn.LSTM,
}


def compare() -> list[dict[str, float | str]]:
    """One row per form: parameters of the memory, seconds of learning, validation losses."""
    trainers = {name: _behind_the_encoder(form) for name, form in FORMS.items()}
    seconds = dict.fromkeys(FORMS, 0.0)
    firsts = np.random.default_rng(SEED).integers(SPAN - LANES, size=LESSONS).tolist()
    for k, taught in enumerate(
        tqdm(simulated("training", firsts), total=LESSONS, unit="lesson", file=sys.stderr)
    ):
        for name, trainer in trainers.items():
            start = time.perf_counter()
            trainer.remember(taught, MEMORY_RATE * (1.0 - k / LESSONS))
            seconds[name] += time.perf_counter() - start
    validation = list(simulated("validation", tried()))
    rows = []
    for name, trainer in trainers.items():
        trainer.validation = validation
        size = sum(parameter.numel() for parameter in trainer.network.memory.parameters())
        rows.append(
            {"form": name, "parameters": size, "seconds": round(seconds[name], 1)}
            | trainer.validate()
        )
    return rows


def _behind_the_encoder(form: type[nn.Module]) -> IntegratedTrainer:
    trainer = IntegratedTrainer(SEED, form)
    learnt = {name: torch.from_numpy(tensor) for name, tensor in storage.read(PACKAGED)[0].items()}
    fresh = ("memory", "correction", "sharpness", "bias")
    kept = {name: tensor for name, tensor in learnt.items() if not name.startswith(fresh)}
    trainer.network.load_state_dict(kept, strict=False)
    return trainer


def main() -> None:
    """Compare, print the table, and put it into the card."""
    rows = compare()
    for row in rows:
        print(
            *(
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in row.items()
            )
        )
    card = json.loads(CARD.read_text(encoding="utf-8"))
    card["memory_forms"] = {
        "command": "python -m training.studies.memories",
        "seed": SEED,
        "rows": rows,
    }
    write_json(CARD, card)


if __name__ == "__main__":
    main()
