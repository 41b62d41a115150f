"""The standard streams while a command runs: foreign text and a lost reader do no harm."""

import errno
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from io import StringIO, TextIOWrapper
from typing import Any, TextIO

from auv_fault_env.printable import printable

BAD_INPUT = 2  # exit code
LAST_STANDARD_STREAM = 2  # descriptor of standard error


class Closed(StringIO):
    """The stream of a descriptor that was closed before the process began."""

    def write(self, text: str) -> int:
        """Raise `OSError`."""
        raise OSError(errno.EBADF, "it is closed")


class Terminal:
    """A text stream that shows any text, and goes on when its reader or its disk has gone.

    Control characters are escaped. After an error of writing, what follows is discarded.
    """

    def __init__(self, stream: TextIO, kept: str):
        self.stream = stream
        self._kept = kept
        # not before the arguments are parsed: the help texts have colours
        self.escapes = False
        self.error: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        """Write the text as it can be shown."""
        shown = printable(text, self._kept) if self.escapes else text
        self._try(self.stream.write, shown)
        return len(text)

    def flush(self) -> None:
        """Pass on what has been written."""
        self._try(self.stream.flush)

    def _try(self, action: Callable[..., Any], *arguments: str) -> None:
        if self.error is not None:
            return
        try:
            action(*arguments)
        except OSError as error:
            self.error = error
            # what is left in the buffers goes nowhere, so that the end of the process cannot fail
            with suppress(OSError, ValueError):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self.stream.fileno())
                os.close(nowhere)

    def reason_of_loss(self) -> str:
        """Why output was lost; empty if none was, or if its reader did not want it."""
        self.flush()
        if self.error is None or self.error.errno == errno.EPIPE:
            return ""
        return self.error.strerror or str(self.error)


@contextmanager
def terminal() -> Iterator[tuple[Terminal, Terminal]]:
    """Standard output and standard error as `Terminal` each, until the context ends.

    Characters that the encoding of standard output lacks are replaced, and numerical warnings of
    libraries are not shown.
    """
    _open_standard_descriptors()
    output = Terminal(sys.stdout or Closed(), kept="\n\t")
    # bars of progress return to the start of their line
    errors = Terminal(sys.stderr or Closed(), kept="\n\t\r")
    if isinstance(output.stream, TextIOWrapper):
        output.stream.reconfigure(errors="replace")
    with redirect_stdout(output), redirect_stderr(errors), _without_numerical_warnings():
        yield output, errors


@contextmanager
def _without_numerical_warnings() -> Iterator[None]:
    """Show no warning of an overflow or a mean of nothing: it says nothing to a user.

    Filters decide first, so that tests and ``python -W error`` fail by them.
    """
    show = warnings.showwarning

    def show_others(message, category, *arguments, **options):
        if not issubclass(category, RuntimeWarning):
            show(message, category, *arguments, **options)

    warnings.showwarning = show_others
    try:
        yield
    finally:
        warnings.showwarning = show


def run_guarded(program: str, command: Callable[[Terminal, Terminal], int]) -> int:
    """The exit code of a command that prints to `terminal`.

    Output that is lost because its reader has closed the pipe changes nothing; output that cannot
    be written for another reason is an error of code 2, unless the code is higher.

    Parameters
    ----------
    program
        Name before the line of error.
    command
        Takes standard output and standard error, and returns or exits with its code.
    """
    with terminal() as (output, errors):
        try:
            code = command(output, errors)
        except SystemExit as end:  # of the parser, which has printed help or an error
            code = end.code
        reason = output.reason_of_loss()
        if reason and code != BAD_INPUT:
            remedy = "send it elsewhere; the files of a report are whole"
            print(f"{program}: standard output is lost: {reason}; {remedy}", file=errors)
            code = max(code, BAD_INPUT)
        errors.flush()
    return code


def _open_standard_descriptors() -> None:
    """Open the null device in place of standard streams that are closed.

    Else the next file takes the number, and receives what libraries print.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= LAST_STANDARD_STREAM:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)


def without_guard(stream: TextIO | Terminal) -> TextIO:
    """The stream itself, whose errors of writing are raised."""
    return stream.stream if isinstance(stream, Terminal) else stream
