"""``auv-fault vehicle init LOG``: proposes a vehicle file from a log."""

import os

from auv_fault_env.errors import InputError, refusal
from auv_fault_env.printable import printable
from training.arguments import Vehicle
from training.field.logs.files import read_table
from training.field.proposal.proposal import propose
from training.field.proposal.text import text_of
from training.field.proposal.trial import try_on
from training.field.vehicle_file import write_text


def main(arguments: Vehicle) -> None:
    """Write the proposal; print every column with what it was taken for, and why.

    `InputError` for a log that cannot be read, and, once the file is written, for one that the file
    does not read.
    """
    table = read_table(arguments.log)
    if os.path.lexists(arguments.output):
        raise refusal("output", str(arguments.output), "a new file", "choose another --output")
    proposal = propose(table, printable(arguments.log.name.split(".")[0]))
    trial = try_on(arguments.log, proposal)
    write_text(arguments.output, text_of(proposal))
    paragraphs = {
        "repaired": table.remarks,
        "used": proposal.used,
        "left out": proposal.left_out,
        "unknown": (", ".join(map(repr, proposal.unknown)),) if proposal.unknown else (),
        "not found": (f"{name}: {about}" for name, about in proposal.missing.items()),
        "tried": (f"the file reads this log: {trial.about}",) if trial.is_read else (),
    }
    for heading, lines in paragraphs.items():
        for line in lines:
            print(f"{heading:<11}{line}")
    n_channels = len(proposal.vehicle.columns) if proposal.has_reading else 0
    print(f"{arguments.output}: {n_channels} channels; check the file before you use it")
    if not trial.is_read:
        remedy = "complete the file by hand, see docs/vehicle.md"
        file = printable(str(arguments.output))
        raise InputError(f"{file} is written but does not read the log: {trial.about}; {remedy}")
