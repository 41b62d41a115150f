"""What is known of each diagnoser before the trials: what its beliefs depend on, and its cost."""

import sys
from collections.abc import Mapping
from typing import Any, NamedTuple

from tqdm import tqdm

from training.benchmark import timing, trial_store
from training.benchmark.failures import note_failure, one_line
from training.benchmark.trials import Entrant
from training.benchmark.workers import call_for
from training.seeds import seeds

TIMED = 950_000_000  # first test seed of the episodes that the timing runs on


class PreparedEntrant(NamedTuple):
    """A diagnoser that can be run."""

    entrant: Entrant
    fingerprint: str  # what its beliefs depend on
    weights: str | None  # digest of its weights, if it has any
    compute: dict[str, float]  # what an update costs, and how many numbers its weights have
    knows_truth: bool  # receives the truth about the vehicles, and so does not compete


def prepare(
    entrants: Mapping[str, Entrant],
) -> tuple[dict[str, PreparedEntrant], dict[str, str]]:
    """The diagnosers that can be created and timed, and why others cannot."""
    prepared: dict[str, PreparedEntrant] = {}
    failures: dict[str, str] = {}
    first_seed = seeds("test", 1, TIMED)[0]
    for name, entrant in tqdm(entrants.items(), desc="timing", unit="diagnoser", file=sys.stderr):
        try:
            prepared[name] = PreparedEntrant(
                entrant, **call_for(entrant, findings, entrant, first_seed)
            )
        # whatever fails in one diagnoser, the others are scored
        except (Exception, SystemExit) as error:
            note_failure(failures, name, one_line(error))
    return prepared, failures


def findings(entrant: Entrant, first_seed: int) -> dict[str, Any]:
    """All of a `PreparedEntrant` but the entrant, as plain data."""
    diagnoser = entrant.make()
    tensors = diagnoser.tensors() if hasattr(diagnoser, "tensors") else {}
    compute = timing.compute_cost(diagnoser, first_seed)
    compute["numbers"] = sum(int(tensor.size) for tensor in tensors.values())
    return {
        "fingerprint": trial_store.fingerprint(entrant, diagnoser),
        "weights": trial_store.weights_digest(diagnoser),
        "compute": compute,
        "knows_truth": hasattr(diagnoser, "set_truth"),
    }
