"""The first wrong word of a command line, refused in one line."""

import dataclasses
import inspect
import re
import shlex
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from tyro.conf import Positional, UseAppendAction
from tyro.constructors import PrimitiveConstructorSpec

from auv_fault_env.errors import InputError, known_name, refusal
from auv_fault_env.printable import printable
from training.allowed import Range

POSITIONAL = get_args(Positional[str])[1]
APPENDED = get_args(UseAppendAction[str])[1]
FRAME = re.compile("[\u2500-\u257f]|-{3,}")  # lines around the parser's messages
KINDS = {Path: "a path", int: "a whole number", float: "a number", str: "a text", bool: "no value"}


class Argument(NamedTuple):
    """An option or an argument by position, as the command line has it."""

    name: str  # `--option`, or in capitals by position
    usage: str  # the argument as it is written
    allowed: str
    kind: Any  # type of each of its words
    choices: tuple[str, ...] = ()
    is_required: bool = False
    is_positional: bool = False
    is_switch: bool = False
    has_many: bool = False


HELP = Argument("--help", "--help", KINDS[bool], bool, is_switch=True)


def refusal_of_command(
    program: str, words: Sequence[str], commands: Mapping[str, type], message: str
) -> InputError:
    """As `refusal_of_words`, for words whose first one is to name a command."""
    try:
        name = known_name("command", words[0].replace("_", "-"), commands)
    except InputError as error:
        return error
    return refusal_of_words(f"{program} {name}", words[1:], commands[name], message)


def refusal_of_words(
    program: str, words: Sequence[str], target: Callable[..., Any], message: str
) -> InputError:
    """The refusal of words that the parser has refused.

    Parameters
    ----------
    program
        What comes before the words.
    words
        Of the command line.
    target
        Dataclass of the arguments, or a function that takes them or their dataclass.
    message
        The parser's own one, for words that are wrong in a way unknown here.
    """
    try:
        _check(program, words, target)
    except InputError as error:
        return error
    plain = " ".join(FRAME.sub(" ", message).split())
    allowed = f"what `{program} --help` shows"
    return refusal("arguments", shlex.join(words), allowed, plain or "correct them")


def _check(program: str, words: Iterable[str], target: Callable[..., Any]) -> None:
    """Raise `InputError` for the first word that is wrong, or for what is missing."""
    arguments = _arguments(target)
    help_hint = f"`{program} --help` explains all"
    options = {one.name: one for one in (*arguments, HELP) if not one.is_positional}
    positional = deque(one for one in arguments if one.is_positional)
    given = set()
    negations = (f"--no-{one.name[2:]}" for one in arguments if one.is_switch)
    names = [*options, *negations]
    left = deque(words)
    while left:
        word = left.popleft()
        if not _is_option(word):
            if not positional:
                allowed = " ".join(one.usage for one in arguments if one.is_positional)
                remedy = f"leave it out; {help_hint}"
                raise refusal("argument", word, allowed or "options only", remedy)
            argument = positional.popleft()
            values = [word]
        else:
            spelt, has_value, value = word.replace("_", "-").partition("=")
            name = known_name("option", spelt, names)
            argument = options.get(name) or options[name.replace("--no-", "--", 1)]
            if argument.is_switch and has_value:
                raise refusal(name, value, argument.allowed, f"write it alone; {help_hint}")
            values = [word.partition("=")[2]] if has_value else []
        while left and not _is_option(left[0]) and _takes_more(argument, len(values)):
            values.append(left.popleft())
        _check_values(argument, values, help_hint)
        given.add(argument.name)
    missing = [one for one in arguments if one.is_required and one.name not in given]
    if missing:
        usages = " ".join(one.usage for one in missing)
        raise _got_nothing(
            ", ".join(one.name for one in missing),
            " and ".join(one.allowed for one in missing),
            f"add {usages}; {help_hint}",
        )


def _is_option(word: str) -> bool:
    """Whether a word is the name of an option, and no value such as -0.5."""
    try:
        float(word)
    except ValueError:
        return word.startswith("-") and word.strip("-") != ""
    return False


def _takes_more(argument: Argument, n_values: int) -> bool:
    return argument.has_many or (n_values == 0 and not argument.is_switch)


def _check_values(argument: Argument, values: Sequence[str], help_hint: str) -> None:
    if not values and not argument.has_many and not argument.is_switch:
        remedy = f"write {argument.usage}; {help_hint}"
        raise _got_nothing(argument.name, argument.allowed, remedy)
    for value in values:
        if argument.choices:
            known_name(argument.name, value, argument.choices)
        elif argument.kind in (int, float):
            try:
                argument.kind(value)
            except ValueError:
                raise refusal(argument.name, value, argument.allowed, "give one") from None


def _got_nothing(thing: str, allowed: str, remedy: str) -> InputError:
    return InputError(printable(f"{thing}: got nothing; allowed is {allowed}; {remedy}"))


def _arguments(target: Callable[..., Any]) -> list[Argument]:
    """The arguments of a dataclass, or of a function that takes them or their dataclass."""
    if dataclasses.is_dataclass(target):
        fields = dataclasses.fields(target)
        required = {
            one.name: one.default is one.default_factory is dataclasses.MISSING for one in fields
        }
    else:
        parameters = inspect.signature(target).parameters.values()
        required = {one.name: one.default is one.empty for one in parameters}
    hints = get_type_hints(target, include_extras=True)
    if len(required) == 1 and dataclasses.is_dataclass(hints[next(iter(required))]):
        return _arguments(hints[next(iter(required))])
    return [_argument(name, hints[name], is_required) for name, is_required in required.items()]


def _argument(name: str, hint: Any, is_required: bool) -> Argument:
    notes: Sequence[Any] = ()
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
    if get_origin(hint) in (Union, UnionType):
        hint = next(one for one in get_args(hint) if one is not NoneType)
    has_many = get_origin(hint) is tuple
    kind = get_args(hint)[0] if has_many else hint
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    allowed = "one of " + ", ".join(choices) if choices else KINDS.get(kind, "a word")
    spec = next((note for note in notes if isinstance(note, PrimitiveConstructorSpec)), None)
    if spec is not None:
        kind = str  # the command checks its words
        allowed = spec.description if isinstance(spec, Range) else f"one of {spec.metavar}"
    is_positional = POSITIONAL in notes
    option = "--" + name.replace("_", "-")
    return Argument(
        name=name.upper() if is_positional else option,
        usage=name.upper() if is_positional else f"{option} {name.upper()}",
        allowed=allowed,
        kind=kind,
        choices=choices,
        is_required=is_required and not (is_positional and has_many),
        is_positional=is_positional,
        is_switch=kind is bool,
        has_many=has_many and APPENDED not in notes,
    )
