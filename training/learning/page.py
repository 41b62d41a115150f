"""The page of a training from its card: the learning curve and how the weights were made."""

from collections.abc import Mapping
from typing import Any


def page(card: Mapping[str, Any]) -> dict[str, Any]:
    """The report as plain data."""
    return {
        "title": f"Training of {card['diagnoser']}",
        "command": card["command"],
        "intro": [
            f"{card['epochs']} epochs in {card['seconds']:g} s; the weights are those of epoch "
            f"{card['best_epoch']} with the lowest validation loss.",
            card["data"],
        ],
        "sections": [
            {"heading": "Learning curve", "text": [], "figures": [_curve(card)]},
            {"heading": "Figures", "text": [], "table": _table(card)},
        ],
    }


def _curve(card: Mapping[str, Any]) -> dict[str, Any]:
    losses = {
        part: [epoch[part]["loss"] for epoch in card["history"]] for part in ("train", "validation")
    }
    return {
        "plot": "learning_curve",
        "name": "learning-curve",
        "caption": "Loss after every epoch on the training and on the validation episodes.",
        "data": losses | {"best": card["best_epoch"]},
    }


def _table(card: Mapping[str, Any]) -> dict[str, Any]:
    rows = [["validation", name, f"{value:.4g}"] for name, value in card["validation"].items()]
    rows += [["calibrated", name, _text(value)] for name, value in card["figures"].items()]
    for name, version in card["versions"].items():
        rows.append(["made with", name, version or "not installed"])
    return {"columns": ["of", "what", "value"], "rows": rows}


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
