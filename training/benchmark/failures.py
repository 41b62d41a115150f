"""Diagnosers that fail are left out, and the others are compared."""

import sys

from tqdm import tqdm


def one_line(error: BaseException) -> str:
    """The kind of an exception and its message, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def note_failure(failures: dict[str, str], name: str, reason: str) -> None:
    """Note why a diagnoser is left out, and print it at once."""
    failures[name] = reason
    tqdm.write(f"{name} is left out: {reason}", file=sys.stderr)
