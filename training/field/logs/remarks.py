"""The remarks on the logs of a fleet as a table: one row for what many logs share."""

import re
from collections.abc import Iterable

NUMBER = re.compile(r"(?<![\w.'])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w'])")
EXPLANATION = re.compile(r", as if with [^;]*")
NAMED = 3  # logs in a row


def remark_rows(remarks: Iterable[tuple[str, str]]) -> list[list[str]]:
    """Rows of remark and logs, from pairs of log and remark.

    Remarks that differ in their numbers alone are one row, with the range of each number. A unit
    that explains a log is named only if it explains all logs of the row.

    >>> remark_rows([("a.csv", "rows: 3 left out"), ("b.csv", "rows: 8 left out")])
    [['rows: 3 to 8 left out', 'a.csv, b.csv']]
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for log, remark in remarks:
        key = NUMBER.sub("0", EXPLANATION.sub("", remark))
        groups.setdefault(key, []).append((log, remark))
    rows = []
    for group in groups.values():
        logs = list(dict.fromkeys(log for log, _ in group))
        remarks_of_group = _with_common_explanation([remark for _, remark in group])
        rows.append([_with_ranges(remarks_of_group), _first_names(logs)])
    return rows


def _with_common_explanation(remarks: list[str]) -> list[str]:
    """The remarks, without their explanations where these differ."""
    explanations = {tuple(EXPLANATION.findall(remark)) for remark in remarks}
    return remarks if len(explanations) == 1 else [EXPLANATION.sub("", one) for one in remarks]


def _with_ranges(remarks: list[str]) -> str:
    """The remarks as one, with the least and the largest of each number."""
    columns = iter(list(zip(*map(NUMBER.findall, remarks), strict=True)))

    def span(_: re.Match) -> str:
        """The least and the largest of the next number, once if they are equal."""
        numbers = sorted(next(columns), key=float)
        least = numbers[0]
        largest = numbers[-1]
        return least if float(least) == float(largest) else f"{least} to {largest}"

    return NUMBER.sub(span, remarks[0])


def _first_names(logs: list[str]) -> str:
    if len(logs) <= NAMED:
        return ", ".join(logs)
    return f"{len(logs)} logs: {', '.join(logs[:NAMED])}, …"
