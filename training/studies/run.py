"""What all studies share: the command line, and the run folder with results and page."""

import functools
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, redirect_stderr
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from typing import Any, NoReturn

import tyro

from auv_fault_env.errors import InputError
from training.report.page import print_tables, write_report
from training.report.run_folder import STUDY, run_folder, write_json
from training.terminal import BAD_INPUT, Terminal, run_guarded
from training.wrong_words import refusal_of_words

Report = Mapping[str, Any]


def command_line(main: Callable[..., None]) -> NoReturn:
    """Run a study with the arguments of the process, and exit as ``auv-fault`` does.

    The exit code is 0 on success, 2 on bad input with one line on the error stream, and 130 after
    an interrupt.

    Parameters
    ----------
    main
        Takes one dataclass of options, or plain options, or nothing.
    """
    program = STUDY + Path(sys.argv[0]).stem

    def command(output: Terminal, errors: Terminal) -> int:
        message = StringIO()
        parsing = ExitStack()

        @functools.wraps(main)
        def study(*arguments: Any, **options: Any) -> None:
            parsing.close()
            output.escapes = True
            errors.escapes = True
            main(*arguments, **options)

        try:
            with parsing:
                parsing.enter_context(redirect_stderr(message))
                tyro.cli(study, prog=program, config=(tyro.conf.OmitArgPrefixes,))
        except SystemExit as end:
            if not end.code or not message.getvalue():
                raise
            error = refusal_of_words(program, sys.argv[1:], main, message.getvalue())
            print(f"{program}: {error}", file=sys.stderr)
            return BAD_INPUT
        except InputError as error:
            print(f"{program}: {error}", file=sys.stderr)
            return BAD_INPUT
        except KeyboardInterrupt:
            print(f"{program}: stopped", file=sys.stderr)
            return 130
        return 0

    sys.exit(run_guarded(program, command))


def run_study(
    name: str,
    arguments: Any,
    study: Callable[[Path], dict[str, Any]],
    page: Callable[[dict[str, Any]], Report] | None = None,
    files_to_keep: Sequence[str] = (),
) -> Report:
    """Run a study in its run folder, write results and page there, and print the tables.

    Parameters
    ----------
    name
        Module of the study, for the manifest.
    arguments
        Dataclass of its options; `output` is the run folder.
    study
        Computes the results, plain data, from the folder into which it may write files. The command
        is added to them.
    page
        Makes the page from the results; without it the results hold the page's sections. The table
        of a section with ``printed=False`` is on the page only.
    files_to_keep
        Files of an earlier run at `output` that remain.

    Returns
    -------
    report
        Title, introduction and sections of the page.
    """
    folder_of_run = run_folder(
        arguments.output, name, arguments, files_to_keep=files_to_keep, program=STUDY
    )
    with folder_of_run as folder:
        results = {"command": _command(name, arguments)} | study(folder)
        write_json(folder / "results.json", results)
        report = page(results) if page else results
        write_report(report, folder)
    print_tables(section for section in report["sections"] if section.get("printed", True))
    print(f"\nreport: {arguments.output / 'index.html'}")
    return report


def _command(name: str, arguments: Any) -> str:
    """The command with all options but the output, which changes no result."""
    options = asdict(arguments)
    del options["output"]
    words = []
    for option, value in options.items():
        values = value if isinstance(value, tuple) else (value,)
        if values and value is not None:
            words.append(" ".join([f"--{option.replace('_', '-')}", *map(str, values)]))
    return " ".join([STUDY + name, *words])
