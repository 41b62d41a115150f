"""On which side of the vehicle the columns are: by words, short marks in pairs, and numbers."""

from collections import Counter
from collections.abc import Mapping

from auv_fault_env.parameters import SIDES
from training.field.proposal.header import Name
from training.field.proposal.words import SIDE_PAIRS

Mark = str | int | None  # port or starboard, the number of a shaft, or no mark


def side_marks(names: Mapping[str, Name]) -> dict[str, Mark]:
    """The mark of every column, by label.

    Short marks such as p and s count where the same name with the other mark is in the log. Of
    several numbers in a name the one counts that differs between names that are otherwise equal. A
    name is number 0 where the same one with a 1 is in the log, as in "RPM" and "RPM.1".
    """
    stems = {name.stem for name in names.values()}
    n_alike = Counter(
        _without(stem, place) for stem in stems for place, word in enumerate(stem) if word.isdigit()
    )
    return {label: _mark(name, stems, n_alike) for label, name in names.items()}


def _mark(name: Name, stems: set[tuple[str, ...]], n_alike: Counter) -> Mark:
    words = name.roles & set(SIDES)
    if words:
        return next(iter(words)) if len(words) == 1 else None
    for pair in SIDE_PAIRS:
        for word, other, side in zip(pair, reversed(pair), SIDES, strict=True):
            if word in name.stem and _replaced(name.stem, word, other) in stems:
                return side
    places = [place for place, word in enumerate(name.stem) if word.isdigit()]
    if not places:
        is_first = (*name.stem, "1") in stems and (*name.stem, "2") not in stems
        return 0 if is_first else None
    return int(name.stem[max(places, key=lambda place: n_alike[_without(name.stem, place)])])


def _replaced(stem: tuple[str, ...], word: str, other: str) -> tuple[str, ...]:
    return tuple(other if one == word else one for one in stem)


def _without(stem: tuple[str, ...], place: int) -> tuple[str, ...]:
    """The name with a mark in place of one of its numbers."""
    return (*stem[:place], "#", *stem[place + 1 :])


def side_of(mark: Mark, numbers: list[int], first: int) -> str | None:
    """The side of a mark; None for the third shaft and those after it.

    Parameters
    ----------
    mark
        Of the column.
    numbers
        All that columns of this quantity have, in order.
    first
        Number of the first shaft in this log, 0 or 1.

    Examples
    --------
    >>> side_of(1, [0, 1], 0), side_of(1, [1, 2], 1), side_of(2, [2], 1), side_of(None, [], 1)
    ('starboard', 'port', 'starboard', 'port')
    """
    if mark is None:
        return SIDES[0]
    if isinstance(mark, str):
        return mark
    place = numbers.index(mark) if len(numbers) > 1 else mark - first
    return SIDES[place] if 0 <= place < len(SIDES) else None
