"""Whether the agent wants a memory of its own: ``python -m training.studies.agents``.

Both forms learn from the same start, the same decisions and the same seeds, and are judged on
validation episodes that have not chosen their best epoch. The table goes into the card beside the
weights. It needs the extra `dev`.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from joblib import Parallel, delayed
from tqdm import tqdm

from diagnosers import storage
from training.arguments import TrainStimulus
from training.commands.train_stimulus import name_of
from training.learning.loop import train
from training.learning.outcomes import figures
from training.learning.recurrent_agent import RecurrentTrainer
from training.learning.stimulus import TRIED, StimulusTrainer
from training.report.run_folder import write_json

FORMS: dict[str, type[StimulusTrainer]] = {
    "feed-forward": StimulusTrainer,
    "LSTM": RecurrentTrainer,
}
SEEDS = 3
STEPS = TrainStimulus.steps
JUDGED = 4  # times as many vehicles as choose the best epoch
CARD = (storage.WEIGHTS / name_of("filter_bank", 0)).with_suffix(".json")
TOLD = ("loss", "delay", "isolated", "healthy_rms")


def trained(form: str, seed: int) -> dict[str, float | str]:
    """Train one agent; its parameters, the seconds of it, and its figures on other vehicles."""
    trainer = FORMS[form](seed, steps=STEPS)
    with TemporaryDirectory() as folder:
        progress = train(trainer, form, seed, Path(folder))
    seconds = sum(epoch["seconds"] for epoch in progress.history)
    judged = figures(
        [one for k in range(JUDGED) for one in trainer.outcomes(TRIED * (1 + k))], trainer.budget
    )
    size = sum(parameter.numel() for parameter in trainer.model.policy.parameters())
    row = {"form": form, "seed": seed, "parameters": size, "seconds": round(seconds, 1)}
    return row | {name: round(judged[name], 5) for name in TOLD}


def main() -> None:
    """Compare, print the table, and put it into the card."""
    jobs = [delayed(trained)(form, seed) for seed in range(SEEDS) for form in FORMS]
    done = Parallel(n_jobs=-1, return_as="generator")(jobs)
    rows = list(tqdm(done, total=len(jobs), unit="agent", file=sys.stderr))
    for row in rows:
        print(*(f"{key} {value}" for key, value in row.items()))
    card = json.loads(CARD.read_text(encoding="utf-8"))
    card["memory_forms"] = {"command": "python -m training.studies.agents", "rows": rows}
    write_json(CARD, card)


if __name__ == "__main__":
    main()
