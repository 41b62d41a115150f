"""How the ratios of ``make bench`` have developed: ``python -m training.studies.speed_history``.

Each run of `training.studies.speed` with ``--history FILE`` adds one line of JSON to the file:

    date       of the run, UTC
    revision   of the code, with a `+` if files were changed
    machine    as of `training.studies.speed.machine`
    ratios     {run: its ratio}, the runs of `training.studies.speed.COMPARISONS`

Ratios of two machines differ even where the code does not: compare those of one.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from auv_fault_env.errors import refusal
from auv_fault_env.text_files import text_of
from training.report.figures.registry import draw
from training.report.run_folder import provenance
from training.studies.run import command_line

HISTORY = Path("docs/speed_history.jsonl")
FIGURE = Path("docs/speed_history.png")
KEYS = {"date", "revision", "machine", "ratios"}
# the ratios of the figure by their names in it
SHOWN = {
    "single": "one environment",
    "serial": "4096 vehicles, one thread",
    "parallel": "4096 vehicles, all cores",
}

Entry = dict[str, Any]


@dataclass(frozen=True)
class SpeedHistory:
    """Draw the history of the ratios."""

    history: Path = HISTORY
    """File of the runs."""
    figure: Path = FIGURE
    """Figure to write."""


def main(arguments: SpeedHistory) -> None:
    """Draw the figure."""
    entries = read(arguments.history)
    draw("speed_history", figure_data(entries)).savefig(arguments.figure, dpi=110)


def append(path: Path, machine: Mapping[str, Any], ratios: Mapping[str, float]) -> None:
    """Add a run to the history."""
    entry = {
        "date": datetime.now(UTC).date().isoformat(),
        "revision": provenance()["revision"],
        "machine": machine,
        "ratios": {name: round(ratio, 4) for name, ratio in ratios.items()},
    }
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")


def read(path: Path) -> list[Entry]:
    """The runs of a history in their order; a line of another form is refused."""
    entries = []
    lines = text_of(path, "history of speeds", "a readable file").splitlines()
    for number, line in enumerate(lines, start=1):
        try:
            entry = json.loads(line)
        except ValueError:
            entry = None
        if not isinstance(entry, dict) or set(entry) != KEYS:
            allowed = f"a JSON object of {', '.join(sorted(KEYS))}"
            remedy = "remove the line"
            raise refusal(f"line {number} of {path}", line[:60], allowed, remedy)
        entries.append(entry)
    return entries


def figure_data(entries: Sequence[Entry]) -> dict[str, Any]:
    """The shown ratios by machine: dates and ratios of its runs."""
    machines: dict[str, dict[str, Any]] = {}
    for entry in entries:
        about = entry["machine"]
        name = f"{about['processor']}, {about['cores']} cores"
        of_machine = machines.setdefault(name, {"date": [], "ratios": {}})
        of_machine["date"].append(entry["date"])
        for run, label in SHOWN.items():
            of_machine["ratios"].setdefault(label, []).append(entry["ratios"].get(run))
    return {"machines": machines}


if __name__ == "__main__":
    command_line(main)
