"""The command line ``auv-fault``: each of `COMMANDS` is run by ``main`` of its module."""

import functools
import importlib
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, suppress
from importlib.metadata import PackageNotFoundError, version
from io import StringIO
from typing import Any

import tyro

from training.allowed import check
from training.arguments import COMMANDS
from training.terminal import BAD_INPUT, Terminal, run_guarded

DESCRIPTION = """Propulsion-fault diagnosis for autonomous underwater vehicles.

auv-fault COMMAND --help explains a command, auv-fault --version prints the version."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; 2 and one line of error on bad input."""
    return run_guarded("auv-fault", functools.partial(_parse_and_run, arguments))


def _parse_and_run(arguments: Sequence[str] | None, output: Terminal, errors: Terminal) -> int:
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if arguments[:1] == ["--version"]:
        print(f"auv-fault {_version()}")
        return 0
    if not arguments:
        with suppress(SystemExit):
            _parse(["--help"])
        return BAD_INPUT
    if (command := _parse(arguments)) is None:
        return BAD_INPUT
    output.escapes = True
    errors.escapes = True
    name = next(name for name, kind in COMMANDS.items() if isinstance(command, kind))
    for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        signal.signal(number, _end)
    try:
        return _run(name, command)
    except KeyboardInterrupt as stop:
        reason = str(stop) or "nothing was left behind"
        print(f"auv-fault {name}: stopped; {reason}", file=sys.stderr)
        return 130


def _parse(arguments: list[str]) -> Any:
    """The arguments of the command; None after a line of error, `SystemExit` after help."""
    message = StringIO()
    try:
        with redirect_stderr(message):
            return tyro.extras.subcommand_cli_from_dict(
                COMMANDS, prog="auv-fault", description=DESCRIPTION, args=arguments
            )
    except SystemExit as end:
        if not end.code:
            raise
    # not for --help, which does not wait for numba
    from training.wrong_words import refusal_of_command

    # `train_stimulus` is `train-stimulus` to the parser, too
    name = arguments[0].replace("_", "-")
    error = refusal_of_command("auv-fault", arguments, COMMANDS, message.getvalue())
    program = f"auv-fault {name}" if name in COMMANDS else "auv-fault"
    print(f"{program}: {error}", file=sys.stderr)
    return None


def _version() -> str:
    try:
        return version("auv-fault")
    except PackageNotFoundError:
        return "of a checkout that is not installed"


def _end(number: int, frame: Any) -> None:
    """End at once on a signal: an exception could be lost in compiled code that has called back."""
    from training.report.run_folder import remove_unfinished_runs

    remove_unfinished_runs()
    os._exit(128 + number)


def _run(name: str, command: Any) -> int:
    # after the parser, so that --help does not wait for numba
    from auv_fault_env.errors import InputError

    try:
        check(command)
        module = importlib.import_module(f"training.commands.{name.replace('-', '_')}")
        return module.main(command) or 0
    except InputError as error:
        print(f"auv-fault {name}: {error}", file=sys.stderr)
        return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
