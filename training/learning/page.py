"""The page of a training from its card: the learning curve and how the weights were made."""

from collections.abc import Mapping
from typing import Any


def page(card: Mapping[str, Any]) -> dict[str, Any]:
    """The report as plain data."""
    losses = {
        part: [epoch[part]["loss"] for epoch in card["history"]] for part in ("train", "validation")
    }
    validation = losses["validation"]
    curve = {
        "plot": "learning_curve",
        "name": "learning-curve",
        "caption": "Loss after every epoch on the training and on the validation episodes.",
        "data": losses | {"best": card["best_epoch"]},
    }
    rows = [["validation", name, f"{value:.4g}"] for name, value in card["validation"].items()]
    rows += [["calibrated", name, _text(value)] for name, value in card["figures"].items()]
    for name, version in card["versions"].items():
        rows.append(["made with", name, version or "not installed"])
    table = {"columns": ["of", "what", "value"], "rows": rows}
    return {
        "title": f"Training of {card['diagnoser']}",
        "command": card["command"],
        "summary": [
            f"{card['epochs']} epochs in {_duration(card['seconds'])}. The weights are those of "
            f"epoch {card['best_epoch']}, whose validation loss is the lowest: "
            f"{validation[card['best_epoch'] - 1]:.4g}, after {validation[0]:.4g} in the first.",
            _judgement(card, losses["train"][card["best_epoch"] - 1]),
        ],
        "intro": [card["data"]],
        "sections": [
            {"heading": "Learning curve", "text": [], "figures": [curve]},
            {"heading": "Scores and versions", "text": [], "table": table},
        ],
    }


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 300.0 else f"{seconds / 60.0:.0f} minutes"


def _judgement(card: Mapping[str, Any], train_loss: float) -> str:
    """Whether more epochs might help, and how far the weights learnt episodes by heart."""
    gap = f"On the training episodes it is {train_loss:.4g} there"
    if card["best_epoch"] == card["epochs"]:
        return f"{gap}. The loss fell to the last epoch: more epochs may help."
    return f"{gap}. Later epochs did not lower the validation loss."


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
