"""Which seeds serve which purpose: disjoint ranges, so that nothing is ever tuned on what it is scored on."""

from auv_fault_env.errors import finite_in_range, known_name, refusal

SPAN = 10**9  # seeds of a purpose; up to there they belong to examples and to the user
PURPOSES = ("training", "calibration", "validation", "test")


def seeds(purpose: str, count: int, first: int = 0) -> range:
    """`count` seeds of a purpose, from the first-th on; those of different purposes never meet.

    >>> seeds("validation", 2)
    range(3000000000, 3000000002)
    """
    start = SPAN * (1 + PURPOSES.index(known_name("purpose of seeds", purpose, PURPOSES)))
    finite_in_range("first seed", first, 0, SPAN - 1)
    if not 0 <= first + count <= SPAN:
        raise refusal("number of seeds", count, f"up to {SPAN - first}", "ask for fewer")
    return range(start + first, start + first + count)


def purpose_of(seed: int) -> str | None:
    """The purpose that a seed is kept for; None for those of examples and users.

    >>> purpose_of(3000000001), purpose_of(7)
    ('validation', None)
    """
    block = seed // SPAN - 1
    return PURPOSES[block] if 0 <= block < len(PURPOSES) else None
