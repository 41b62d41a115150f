"""A proposed vehicle file as text, with the channels that have no column as comments."""

from training.field.proposal.proposal import Proposal
from training.field.vehicle_file import as_toml


def text_of(proposal: Proposal) -> str:
    """The TOML text: every channel has its table, or one behind comment marks to fill in."""
    text = as_toml(proposal.vehicle, proposal.comments)
    if not proposal.has_reading:
        text = text.partition("\n[channels.speed]")[0]
    tables = [
        f'# [{name if name == "time" else f"channels.{name}"}]  # {about}\n# column = ""\n'
        for name, about in proposal.missing.items()
    ]
    return "\n".join([text, *tables])
