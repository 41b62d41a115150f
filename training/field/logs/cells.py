"""The cells of a text log, in files and in streams: how lines are split, and what a cell means."""

import csv
import re
from collections import Counter
from collections.abc import Sequence

from training.field.logs.notations import is_stamp
from training.field.logs.numerals import NARROW_MARKS, TRUTH, UNIT

# of the cells of a line, by the name in remarks; the last: any number of blanks
SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
COMMENT_MARKS = "#%/"
LONGEST_LINE = 100_000  # characters
MISSING = ("", *"- -- --- ? * nan null none nil na n/a n.a. nat missing".split())
# what spreadsheets write for a value that they do not have
MISSING += ("#n/a", "#na", "#nv", "#value!", "#wert!", "#div/0!", "#ref!", "#bezug!", "#num!")
LEAST_OF_NUMBERS = 0.5  # share of numbers of a row of numbers
VALUE_WORDS = frozenset((*MISSING, *TRUTH, "inf", "-inf", "infinity", "-infinity"))
VALUE = re.compile(
    rf"[+\-\u2212]?(?:\d{{1,3}}(?:[.,{NARROW_MARKS}]\d{{3}})+|\d*)(?:\d[.,]?|[.,]\d+)"
    rf"(?:[eE][+-]?\d+)?\s*(?:{UNIT})?"
)


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without the blanks and quotation marks around them.

    Where blanks separate, a unit in brackets stays with its name. `csv.Error` if it is no line.

    >>> cells_of('1.5, "2", east', ",")
    ['1.5', '2', 'east']
    """
    if separator == " ":
        return re.split(r"\s+(?![\[(])", line.strip())
    cells = next(csv.reader([line], delimiter=separator), [])
    return [cell.strip(" \t\"'") for cell in cells]


def without_stray_quotes(line: str) -> str:
    """The line without quotation marks if their number is odd: they would swallow other cells."""
    return line.replace('"', "") if line.count('"') % 2 else line


def separator_of(lines: Sequence[str]) -> str:
    """The separator that divides these lines into several cells, with most numbers among them."""

    def score(separator: str) -> tuple[bool, float]:
        rows = [cells_of(line, separator) for line in lines]
        width = usual_width(rows)
        weights = [_weight(row) for row in rows if len(row) == width]
        of_numbers = [weight for weight in weights if weight > LEAST_OF_NUMBERS]
        return width > 1, sum(of_numbers or weights)

    return max(SEPARATORS, key=score)


def usual_width(rows: Sequence[Sequence[str]]) -> int:
    """Number of cells of the rows that make up most of the table."""
    weights: Counter[int] = Counter()
    for row in rows:
        weights[len(row)] += len(row) * _weight(row)
    return max(weights, key=lambda width: weights[width])


def _weight(row: Sequence[str]) -> float:
    """Weight of a row in the choice of a layout: rows of numbers outweigh any lines of words."""
    share = share_of_values(row)
    return share if share > LEAST_OF_NUMBERS else 1e-4 * (share + 0.1)


def share_of_values(row: Sequence[str]) -> float:
    """Share of the cells that are numbers, time stamps or words for missing; empty cells aside.

    None is, where true and false stand only beside other words: these describe the columns.
    """
    filled = list(filter(None, row))
    values = [cell for cell in filled if _is_value(cell)]
    if len(values) < len(filled) and TRUTH.keys() >= {cell.lower() for cell in values}:
        return 0.0
    return len(values) / len(filled) if filled else 0.0


def _is_value(cell: str) -> bool:
    return bool(VALUE.fullmatch(cell)) or cell.lower() in VALUE_WORDS or is_stamp(cell)


def matching_names(
    names: Sequence[str], rows: Sequence[Sequence[str]], separator: str
) -> Sequence[str]:
    """The names of a header, one per cell of the rows below it where that is possible.

    Header or rows may end with a separator, and rows may begin with a number that has no name.
    """
    width = len(rows[0])
    if len(names) == width + 1 and not names[-1]:
        return names[:-1]
    if len(names) == width - 1:
        if not any(row[-1] for row in rows):
            return [*names, ""]
        if separator in "\t ":
            return ["", *names]
    return names
