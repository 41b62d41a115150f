"""A proposed vehicle file, tried on the log that it was proposed from."""

from pathlib import Path
from typing import NamedTuple

from auv_fault_env.errors import InputError
from training.field.logs.log import read_log
from training.field.proposal.proposal import Proposal


class Trial(NamedTuple):
    """Whether the log can be read with the file, and what was found."""

    is_read: bool
    about: str


def try_on(log: Path, proposal: Proposal) -> Trial:
    """Read the log as the file describes it; a rate that is not that of the rows is a failure."""
    vehicle = proposal.vehicle
    if not proposal.has_reading:
        return Trial(False, "no column is a reading")
    if not proposal.rate_is_known:
        return Trial(False, proposal.missing["time"])
    try:
        recording = read_log(log, vehicle)
    except InputError as error:
        return Trial(False, str(error))
    wrong_rate = [remark for remark in recording.remarks if "as sample_rate says" in remark]
    if wrong_rate:
        return Trial(False, wrong_rate[0])
    count = len(recording.segments)
    segments = f" in {count} segments" if count > 1 else ""
    seconds = recording.time[-1]
    return Trial(True, f"{seconds:.6g} s{segments} at {vehicle.sample_rate:g} rows a second")
