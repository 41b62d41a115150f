"""Diagnosers of third parties as entrants: none of their code runs in this process."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from tqdm import tqdm

from auv_fault_env.errors import InputError
from diagnosers import NAMES, Diagnoser
from diagnosers.third_party import ForeignCodeError, ThirdParty, installed_third_parties
from training.benchmark.failures import CallFailed, note_failure, one_line
from training.benchmark.own_process import call_in_own_process


class Party(Protocol):
    """Something from outside the package that makes a diagnoser; it can be pickled."""

    @property
    def target(self) -> str:
        """Its place, as it was named."""

    @property
    def source(self) -> Path:
        """The file that the diagnoser comes from."""

    def __call__(self) -> Diagnoser:
        """A diagnoser."""


@dataclass(frozen=True)
class OwnProcess:
    """What makes the diagnoser of a third party, to be called in a process of its own only.

    Attributes
    ----------
    party
        Makes it, such as the place of its class.
    time_limit
        Most seconds that it may take for a trial, and for what comes before and after the trials.
    """

    party: Party
    time_limit: float

    def __call__(self) -> Diagnoser:
        """A diagnoser."""
        return self.party()

    @property
    def target(self) -> str:
        """The place of the diagnoser, as it was named."""
        return self.party.target

    @property
    def source(self) -> Path:
        """The file that the diagnoser comes from."""
        return self.party.source


def load_third_parties(
    targets: Sequence[str], time_limit: float
) -> tuple[dict[str, OwnProcess], dict[str, str]]:
    """Third parties by name, at the targets and of installed packages, and why others fail.

    One that fails, or whose name is that of another diagnoser, has its target as its name. Raises
    `InputError` where there is no class at a target.
    """
    named: dict[str, OwnProcess] = {}
    failures: dict[str, str] = {}
    places = dict.fromkeys(ThirdParty(target) for target in targets)
    found = [("", party) for party in places] + installed_third_parties()
    bar = tqdm(found, desc="third parties", unit="diagnoser", file=sys.stderr, leave=False)
    for name, party in bar:
        try:
            name = party.checked_name(name) if name else name_of(party, time_limit)
        except (CallFailed, ForeignCodeError) as error:
            note_failure(failures, party.target, one_line(error))
            continue
        if name in NAMES or name in named:
            reason = f"another diagnoser has its name {name!r}: rename it"
            note_failure(failures, party.target, reason)
            continue
        named[name] = OwnProcess(party, time_limit)
    return named, failures


def name_of(party: ThirdParty, time_limit: float) -> str:
    """The name of its diagnoser; raises `CallFailed`, or `InputError` if there is no class."""
    answer = call_in_own_process(_name_or_refusal, party, limit=time_limit)
    if "refusal" in answer:
        raise InputError(answer["refusal"])
    return answer["name"]


def _name_or_refusal(party: ThirdParty) -> dict[str, str]:
    try:
        return {"name": party.name}
    except ForeignCodeError:
        raise
    except InputError as error:
        return {"refusal": str(error)}
