"""Seeds by purpose, in disjoint ranges: nothing is tuned on what it is scored on."""

import hashlib

from auv_fault_env.errors import known_name, refusal

SPAN = 10**9  # seeds of a purpose; up to there they belong to examples and to the user
PURPOSES = ("training", "calibration", "validation", "test")
FIRST_DRAWN = 2**61  # beyond the seeds of every purpose: those that a digest chooses
DRAWN_TOGETHER = 2**24
N_DRAWS = 2**37
# the purposes by the names of the parts of a data set
SPLITS = {"train": "training"} | {purpose: purpose for purpose in PURPOSES[1:]}


def seeds(purpose: str, count: int, first: int = 0) -> range:
    """`count` seeds of a purpose from number `first` on; purposes share no seed.

    >>> seeds("validation", 2)
    range(3000000000, 3000000002)
    """
    known_name("purpose of seeds", purpose, PURPOSES)
    start = SPAN * (1 + PURPOSES.index(purpose))
    if not 0 <= first < SPAN:
        allowed = f"a number within the {purpose} seeds, 0 to {SPAN - 1}"
        raise refusal("seed", first, allowed, "give one in that range")
    if not 0 <= first + count <= SPAN:
        raise refusal("number of seeds", count, f"up to {SPAN - first}", "ask for fewer")
    return range(start + first, start + first + count)


def purpose_of(seed: int) -> str | None:
    """The purpose of a seed; None for those of examples and users.

    >>> purpose_of(3000000001), purpose_of(7)
    ('validation', None)
    """
    block = seed // SPAN - 1
    return PURPOSES[block] if 0 <= block < len(PURPOSES) else None


def drawn_seeds(key: str) -> range:
    """`DRAWN_TOGETHER` seeds of no purpose, which the SHA-256 of the key chooses.

    Who does not know the key cannot know the seeds. Two keys share seeds with odds of 1 to 2^37.
    """
    number = int.from_bytes(hashlib.sha256(key.encode()).digest())
    first = FIRST_DRAWN + DRAWN_TOGETHER * (number % N_DRAWS)
    return range(first, first + DRAWN_TOGETHER)
