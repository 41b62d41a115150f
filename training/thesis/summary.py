"""The summary of the report: how many results agree with the thesis, and which do not."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from training.thesis.comparison import AGREES, COLUMNS, DIFFERS, IN_PART, VERDICT

N_DIFFERENCES = 4  # that are named


def summary(sections: Sequence[Mapping[str, Any]]) -> list[str]:
    """How many results agree with the thesis, and which do not."""
    compared = [
        row
        for section in sections
        if section.get("table", {}).get("columns") == COLUMNS
        for row in section["table"]["rows"]
    ]
    verdicts = [row[COLUMNS.index(VERDICT)] for row in compared]
    counts = Counter(verdicts)
    judged = counts[AGREES] + counts[IN_PART] + counts[DIFFERS]
    differing = [
        f"{where}: {quantity}"
        for (where, quantity, *_), verdict in zip(compared, verdicts, strict=True)
        if verdict == DIFFERS
    ]
    sentences = [
        f"The thesis' test runs and networks were repeated, and {judged} results compared with "
        f"the thesis: {counts[AGREES]} agree without noise, {counts[IN_PART]} agree in part, "
        f"{counts[DIFFERS]} differ. Each difference has its reason in the tables.",
    ]
    if not differing:
        sentences.append("No result differs.")
    else:
        shown = "; ".join(differing[:N_DIFFERENCES])
        rest = len(differing) - N_DIFFERENCES
        sentences.append(f"Those that differ: {shown}{f'; and {rest} more' if rest > 0 else ''}.")
    return sentences
