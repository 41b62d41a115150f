"""Diagnosers that fail are left out, and the others are compared."""

import sys

from tqdm import tqdm

from auv_fault_env.errors import InputError
from auv_fault_env.printable import printable

LONGEST_REASON = 500  # characters


class CallFailed(Exception):
    """What a process did instead of answering a call, in one line."""


def one_line(error: BaseException) -> str:
    """The kind of an exception and its message, in one line that any file and terminal can hold."""
    try:
        message = str(error)
    # the exception may be of foreign code
    except BaseException:
        message = "a message that cannot be shown"
    is_reason = isinstance(error, CallFailed | InputError)
    text = message if is_reason else f"{type(error).__name__}: {message}"
    return printable(" ".join(text.split()).removesuffix(":"), longest=LONGEST_REASON)


def note_failure(failures: dict[str, str], name: str, reason: str) -> None:
    """Note why a diagnoser is left out, and print it at once."""
    failures[name] = reason
    tqdm.write(f"{printable(name)} is left out: {reason}", file=sys.stderr)
