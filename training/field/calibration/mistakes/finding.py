"""One likely mistake."""

from typing import NamedTuple


class Finding(NamedTuple):
    """A likely mistake in the vehicle file, or in the choice of the healthy logs."""

    channels: tuple[str, ...]  # whose readings are in doubt
    evidence: str  # what was measured
    cause: str  # the likely one, as a question
    remedy: str  # what to change
    log: str = ""  # name of the log, if a log is in doubt and not the vehicle file
    is_fatal: bool = False  # whether a fit to these readings means nothing

    @property
    def subject(self) -> str:
        """What is in doubt."""
        return f"log {self.log}" if self.log else " and ".join(self.channels)

    def __str__(self) -> str:
        return f"{self.subject}: {self.evidence}; {self.cause}; {self.remedy}"
