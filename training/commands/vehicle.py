"""``auv-fault vehicle init LOG``: proposes a vehicle file from a log."""

from auv_fault_env.errors import refusal
from training.arguments import Vehicle
from training.field.logs.files import read_table
from training.field.proposal.proposal import propose
from training.field.vehicle_file import write_vehicle


def main(arguments: Vehicle) -> None:
    """Write the proposal; print each guess with its reason, and the channels without a column."""
    if arguments.output.exists():
        raise refusal("output", str(arguments.output), "a new file", "choose another --output")
    table = read_table(arguments.log)
    proposal = propose(table, arguments.log.name.split(".")[0])
    write_vehicle(arguments.output, proposal.vehicle, proposal.comments)
    guesses = (
        f"{name}: {proposal.comments[f'channels.{name}.column']}"
        for name in proposal.vehicle.columns
    )
    paragraphs = {
        "repaired": table.remarks,
        "found": guesses,
        "not found": proposal.missing,
        "left out": proposal.left_out,
    }
    for heading, lines in paragraphs.items():
        for line in lines:
            print(f"{heading:<11}{line}")
    n_channels = len(proposal.vehicle.columns)
    print(f"{arguments.output}: {n_channels} channels; check the file before you use it")
