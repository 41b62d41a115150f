"""The findings on calibrate's page."""

from collections.abc import Sequence

from training.field.calibration.mistakes.finding import Finding
from training.report.sections import Section, table_section

HEADING = "Likely mistakes"


def mistakes_section(findings: Sequence[Finding]) -> Section | None:
    """What is in doubt, why, the likely cause, and what to change."""
    if not findings:
        return None
    text = (
        "The fit takes the vehicle file and the logs as they are. What is wrong in them becomes "
        "part of the healthy vehicle, and diagnose may call it a fault later. Correct the lines "
        "named here, and calibrate again."
    )
    columns = ["in doubt", "what was measured", "likely cause", "what to change"]
    rows = [[one.subject, one.evidence, one.cause, one.remedy] for one in findings]
    return table_section(HEADING, columns, rows, text)
