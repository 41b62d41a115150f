"""The page of a training from its card: the learning curve and how the weights were made."""

from collections.abc import Mapping
from typing import Any


def page(card: Mapping[str, Any]) -> dict[str, Any]:
    """The report as plain data."""
    losses = {
        part: [epoch[part]["loss"] for epoch in card["history"]] for part in ("train", "validation")
    }
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
        "intro": [
            f"{card['epochs']} epochs in {card['seconds']:g} s; the weights are those of epoch "
            f"{card['best_epoch']} with the lowest validation loss.",
            card["data"],
        ],
        "sections": [
            {"heading": "Learning curve", "text": [], "figures": [curve]},
            {"heading": "Figures", "text": [], "table": table},
        ],
    }


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
