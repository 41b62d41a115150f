"""The relations of a vehicle as plain data, as in the table [relations] of a vehicle file."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from auv_fault_env.errors import finite_in_range, known_name, refusal
from auv_fault_env.parameters import SIDES
from diagnosers.relations.model import RelationModel, Scatter
from diagnosers.relations.windows import Layout, Typical, n_terms

KEYS = (
    "shafts",
    "has_shaft_speed",
    "sample_rate",
    "typical",
    "coefficients",
    "steady",
    "changing",
    "lasting",
    "sizes",
    "shares",
)
LARGEST = 1e12
REMEDY = "calibrate the vehicle again"


def as_table(model: RelationModel) -> dict[str, Any]:
    """The model as plain data; `from_table` makes an equal one."""
    return {
        "shafts": len(model.layout.sides),
        "has_shaft_speed": model.layout.has_shaft_speed,
        "sample_rate": model.layout.sample_rate,
        "typical": {side: list(model.typical[side]) for side in model.layout.sides},
        "coefficients": {name: list(values) for name, values in model.coefficients.items()},
        "steady": {name: list(values) for name, values in model.steady.items()},
        "changing": {name: list(values) for name, values in model.changing.items()},
        "lasting": dict(model.lasting),
        "sizes": dict(model.sizes),
        "shares": {name: list(values) for name, values in model.shares.items()},
    }


def from_table(table: Mapping[str, Any]) -> RelationModel:
    """The model of a table; `InputError` for what is missing or no number."""
    missing = [key for key in KEYS if key not in table]
    if missing:
        raise refusal("key of [relations]", missing[0], "a table with all of its keys", REMEDY)
    shafts = table["shafts"]
    if shafts not in (1, 2) or isinstance(shafts, bool):
        raise refusal("relations.shafts", shafts, "1 or 2", REMEDY)
    has_shaft_speed = table["has_shaft_speed"]
    if not isinstance(has_shaft_speed, bool):
        raise refusal("relations.has_shaft_speed", has_shaft_speed, "true or false", REMEDY)
    rate = finite_in_range("relations.sample_rate [Hz]", table["sample_rate"], 0.5, 10.0)
    layout = Layout(SIDES[:shafts], has_shaft_speed, rate)
    numbers = {
        key: _numbers(table, key, names, counts)
        for key, names, counts in (
            ("typical", layout.sides, dict.fromkeys(layout.sides, 2)),
            ("coefficients", layout.relations, n_terms(layout)),
            ("steady", layout.residuals, dict.fromkeys(layout.residuals, 3)),
            ("changing", layout.residuals, dict.fromkeys(layout.residuals, 3)),
            ("lasting", layout.residuals, dict.fromkeys(layout.residuals, 0)),
            ("sizes", layout.residuals, dict.fromkeys(layout.residuals, 0)),
            ("shares", layout.counted, dict.fromkeys(layout.counted, 2)),
        )
    }
    return RelationModel(
        layout=layout,
        typical={side: Typical(*values) for side, values in numbers["typical"].items()},
        coefficients={name: np.array(values) for name, values in numbers["coefficients"].items()},
        steady={name: Scatter(*values) for name, values in numbers["steady"].items()},
        changing={name: Scatter(*values) for name, values in numbers["changing"].items()},
        lasting={name: values[0] for name, values in numbers["lasting"].items()},
        sizes={name: values[0] for name, values in numbers["sizes"].items()},
        shares={name: (values[0], values[1]) for name, values in numbers["shares"].items()},
    )


def _numbers(
    table: Mapping[str, Any], key: str, names: Iterable[str], counts: Mapping[str, int]
) -> dict[str, list[float]]:
    """Numbers by name: a list of as many as `counts` says, or where that is 0, one number."""
    entries = table[key]
    if not isinstance(entries, Mapping):
        raise refusal(f"relations.{key}", entries, "a table", REMEDY)
    for name in entries:
        known_name(f"key of [relations.{key}]", name, counts)
    found = {}
    for name in names:
        where = f"relations.{key}.{name}"
        values = entries.get(name)
        if counts[name] == 0:
            values = [values]
        if not isinstance(values, list) or len(values) != max(counts[name], 1):
            allowed = f"{counts[name]} numbers"
            raise refusal(where, values, allowed, REMEDY)
        found[name] = [finite_in_range(where, value, -LARGEST, LARGEST) for value in values]
    return found
