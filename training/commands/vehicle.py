"""``auv-fault vehicle init LOG``: proposes the vehicle file that the tools for a real vehicle read."""

from auv_fault_env.errors import refusal
from training.arguments import Vehicle
from training.field.logs.files import read_table
from training.field.proposal.proposal import propose
from training.field.vehicle_file import write_vehicle


def main(arguments: Vehicle) -> None:
    """Write the proposal; print each guess with its reason, and what could not be found."""
    if arguments.output.exists():
        raise refusal("output", str(arguments.output), "a new file", "choose another --output")
    table = read_table(arguments.log)
    proposal = propose(table, arguments.log.name.split(".")[0])
    write_vehicle(arguments.output, proposal.vehicle, proposal.comments)
    found = (
        f"{name}: {proposal.comments[f'channels.{name}.column']}"
        for name in proposal.vehicle.columns
    )
    said = {
        "repaired": table.remarks,
        "found": found,
        "not found": proposal.missing,
        "left out": proposal.left,
    }
    for heading, lines in said.items():
        print("".join(f"{heading:<11}{line}\n" for line in lines), end="")
    print(
        f"{arguments.output}: {len(proposal.vehicle.columns)} channels; read it through before you use it"
    )
