"""Write the table of docs/ecosystem.md from the JUnit reports of the tests in this folder.

``make ecosystem`` runs it. The exit code is 1 if a test did not pass, or a file of tests has not
run; the page is written all the same.
"""

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

PAGE = Path("docs/ecosystem.md")
BEGIN = "<!-- written by make ecosystem -->\n"
END = "<!-- until here -->\n"
ENVIRONMENTS = ("Propulsion-v0", "ActiveDiagnosis-v0")
PASSED = "passed"


class Row(NamedTuple):
    """What stands on the left of a row of the table."""

    library: str
    version: str
    what: str


Results = dict[Row, dict[str, str]]  # words of each environment


def result(case: ElementTree.Element) -> str:
    """How a test ended, with the first line of what went wrong."""
    for outcome in ("failure", "error", "skipped"):
        found = case.find(outcome)
        if found is not None:
            message = found.get("message", "").strip().splitlines() or [""]
            return f"{outcome}: {message[0]}".replace("|", "\\|")
    return PASSED


def results(cases: Iterable[ElementTree.Element]) -> Results:
    """The results by row and environment; one that passed does not hide one that did not."""
    found: Results = {}
    for case in cases:
        given = {one.get("name"): one.get("value", "") for one in case.iter("property")}
        row = Row(given["library"], given["version"], given["what"])
        words = found.setdefault(row, {})
        environment = given["environment"]
        if words.get(environment, PASSED) == PASSED:
            words[environment] = result(case)
    return found


def table(found: Mapping[Row, Mapping[str, str]]) -> str:
    """The table in Markdown, rows by library; empty where no test ran."""
    lines = [["library", "version", "what ran", *ENVIRONMENTS], ["---"] * 5]
    for row in sorted(found):
        lines.append([*row, *(found[row].get(name, "") for name in ENVIRONMENTS)])
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def missing(cases: Iterable[ElementTree.Element], folder: Path) -> list[str]:
    """The files of tests that no case comes from."""
    ran = {case.get("classname", "").rpartition(".")[2] for case in cases}
    return sorted(path.name for path in folder.glob("test_*.py") if path.stem not in ran)


def main(reports: Iterable[str]) -> int:
    """Write the page; 0 if all tests passed."""
    cases = [case for path in reports for case in ElementTree.parse(path).iter("testcase")]
    found = results(cases)
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{BEGIN}{table(found)}{END}{after}", "utf-8")
    not_run = missing(cases, Path(__file__).parent)
    wrong = [
        f"{row.library}, {row.what}, {environment}: {words}"
        for row, by_environment in found.items()
        for environment, words in by_environment.items()
        if words != PASSED
    ]
    wrong += [f"{name}: no test ran; install its library" for name in not_run]
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
