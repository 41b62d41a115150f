"""A column's name taken apart: words with their meanings, unit, numbers and marks of a side."""

import re
import shlex
import unicodedata
from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple

from training.field.logs.cells import MISSING
from training.field.logs.header_rows import UNIT_WORDS
from training.field.proposal.words import (
    GROUP_WORDS,
    GROUPS,
    JOINED,
    OTHERS,
    QUANTITIES,
    ROLES,
    SYMBOLS,
)
from training.field.units import is_unit, other_unit

BRACKETS = re.compile(r"[\[({]([^\[\](){}]*)[\])}]")
UNIT_AT_END = re.compile(r"(?:\s+in\s+|\s*,\s*|\s+/\s*)(?P<unit>[^\s,]+)$")
SYMBOL_PER_UNIT = re.compile(r"[A-Za-z]/(?P<unit>.+)")  # U/V, as DIN 1313 writes it
EAST_ASIAN = "\u3040-\u30ff\u3400-\u9fff"
PIECES = re.compile(rf"[{EAST_ASIAN}]+|(?:(?![{EAST_ASIAN}])[^\W\d_])+|\d{{1,6}}")
PATH = re.compile(r"/|::|(?<!\d)\.|\.(?!\d)")
MOTOR_MARKS = frozenset("mt")  # before a number: m1, T3
LONGEST_PHRASE = 4  # words
LONGEST_UNIT = 5  # words: meters per sec per sec
SHORTEST_PART = 3  # letters of a part of a compound
# units of one letter at the end of a name, and the quantities after which they are meant
LETTER_UNITS = {
    "s": frozenset({"time"}),
    "h": frozenset({"time"}),
    "g": frozenset({"acceleration"}),
}
NO_UNIT = UNIT_WORDS.union(MISSING) - {"nd"}  # in French, knots
SCALED = re.compile(r"(?:(?<![^\W_])[x×]|\*)\s?10+(?!\d)|/\s?100+(?!\d)")  # x10, rpm/100
GARBLED = re.compile(r"\\x[89][0-9a-f]")  # control characters, which no Latin-1 text has
NEITHER_V_NOR_A = frozenset({"rpm", "duty", "time", "rudder"})
LETTERS = str.maketrans({"ø": "o", "Ø": "O", "æ": "ae", "Æ": "Ae", "ß": "ss"})
LINKS = ("", "s", "n", "en", "es", "e")  # between the parts of a compound


class Name(NamedTuple):
    """What a column's name says."""

    quantities: frozenset[str]  # those that its words name
    symbol: str  # its one symbol, if no word names a quantity; else empty
    roles: frozenset[str]  # of `ROLES`
    others: dict[str, str]  # words of quantities that no channel has, and what those are
    unknown: tuple[str, ...]  # words without a known meaning
    unknown_heads: tuple[str, ...]  # those of them that follow the quantity: current_task
    unit: str  # named in brackets, below the header or at the end; empty if none is
    stem: tuple[str, ...]  # words and numbers in order, without unit


def plain(text: str) -> str:
    """The text in small letters without accents, as the words of `words` are compared.

    >>> plain("Tensão"), plain("Strømstyrke")
    ('tensao', 'stromstyrke')
    """
    return without_accents(text).casefold()


def without_accents(text: str) -> str:
    """The text without accents, in letters of usual width, capitals kept."""
    letters = unicodedata.normalize("NFKD", text.translate(LETTERS))
    kept = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return unicodedata.normalize("NFKC", kept).replace("−", "-")


@cache
def _meanings() -> dict[str, tuple[str, ...]]:
    """Meanings by word or phrase."""
    meanings: dict[str, tuple[str, ...]] = {}
    for table in (OTHERS, ROLES, QUANTITIES):
        for meaning, words in table.items():
            for word in shlex.split(words.replace("|", " ")):
                meanings.setdefault(plain(word), ())
                meanings[plain(word)] += (meaning,)
    return meanings | JOINED


def name_of(label: str, unit: str = "") -> Name:
    """Take a name apart; the unit is that of a row below the header.

    >>> name = name_of("thruster2_current_mA")
    >>> name.quantities, sorted(name.roles), name.unit, name.stem
    (frozenset({'current'}), ['motor'], 'mA', ('thruster', '2', 'current'))
    """
    text = without_accents(label).strip()
    if plain(text) in MISSING:
        text = ""
    text, bracket_unit, bracket_words = _without_brackets(text)
    unit = unit or bracket_unit
    unit = "" if unit.lower() in NO_UNIT else unit
    groups = [_words(part) for part in PATH.split(text) if part]
    groups = [words for words in groups if words] or [[]]
    words = [word for group in groups for word in group] + bracket_words
    if not unit:
        words, unit = _without_unit(words)
    stem = tuple(map(plain, words))
    n_before = _words_before_quantity(groups)
    name = _sorted_words(stem, n_before, unit)
    if scaled := SCALED.search(label):
        name.others[scaled[0]] = "a scaled value"
    if GARBLED.search(label):
        name.others[label] = "a thing in an encoding that is not read: convert the log to UTF-8"
    return name


def _without_brackets(text: str) -> tuple[str, str, list[str]]:
    """The text without its brackets, the unit in one of them, and the words in the others."""
    unit = ""
    words: list[str] = []
    for content in BRACKETS.findall(text):
        pieces = _words(content)
        first = content.partition(" ")[0]
        if is_unit(content) or other_unit(content):
            unit = unit or content.strip()
        elif _are_known(pieces):
            words += pieces
        else:
            unit = unit or (first if is_unit(first) else content.strip())
    text = BRACKETS.sub(" ", text).strip()
    match = SYMBOL_PER_UNIT.fullmatch(text) or UNIT_AT_END.search(text)
    if not unit and match and (is_unit(match["unit"]) or other_unit(match["unit"])):
        unit = match["unit"]
        text = text[: match.start("unit")].rstrip("/, ").removesuffix(" in")
    return text, unit, words


def _are_known(words: Sequence[str]) -> bool:
    """Whether all words and phrases have a meaning."""
    phrases = _phrases(tuple(map(plain, words)))
    return all(meanings or _is_known(phrase) for phrase, meanings in phrases)


def _is_known(word: str) -> bool:
    return word.isdigit() or plain(word) in _meanings() or plain(word) in SYMBOLS


def _words(text: str) -> list[str]:
    """The words of a text: cut at marks and digits, at capitals, and compounds into parts."""
    words: list[str] = []
    for piece in PIECES.findall(text):
        if piece.isdigit() or _is_known(piece) or is_unit(piece) or other_unit(piece):
            words.append(piece)
        elif piece.isascii():
            for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", piece):
                words += _compound(plain(word)) or (word,)
        else:
            words += _compound(plain(piece)) or _longest_known(plain(piece))
    return words


@cache
def _compound(word: str) -> tuple[str, ...]:
    """The known words that a compound consists of; empty if it is none."""
    meanings = _meanings()
    shortest = SHORTEST_PART if word.isascii() else 1
    if word in meanings:
        return (word,)
    for end in range(len(word) - shortest, shortest - 1, -1):
        head = word[:end]
        if head not in meanings:
            continue
        for link in LINKS:
            rest = _compound(word[end + len(link) :]) if word[end:].startswith(link) else ()
            if rest:
                return (head, *rest)
    return ()


def _longest_known(text: str) -> list[str]:
    """Words of a text without blanks, each the longest that is known; the rest is one word."""
    words = []
    while text:
        ends = range(len(text), 0, -1)
        end = next((end for end in ends if text[:end] in _meanings()), len(text))
        words.append(text[:end])
        text = text[end:]
    return words


def _without_unit(words: list[str]) -> tuple[list[str], str]:
    """The words without the unit at their end, which may be followed by a number; and the unit."""
    for tail in ((), words[-1:]):
        if tail and not tail[0].isdigit():
            break
        body = words[: len(words) - len(tail)]
        for count in range(min(LONGEST_UNIT, len(body)), 0, -1):
            unit = _unit_of(body[-count:], body[:-count])
            if unit:
                is_word = count == 1 and plain(body[-1]) in _meanings()
                kept = body if is_word or count == len(body) else body[:-count]
                return [*kept, *tail], unit
    inner = (word for word in words if len(word) > 2 and is_unit(word))
    return words, next(inner, "")


def _unit_of(words: Sequence[str], before: Sequence[str]) -> str:
    """The unit that words write: m_s, meters per sec, mA; one letter only if it can be meant."""
    if len(words) == 1:
        word = words[0]
        if len(word) == 1:
            return word if _is_letter_meant(plain(word), before) else ""
        return word if is_unit(word) or other_unit(word) else ""
    quotient = ""
    for word in words:
        is_part = word.isdigit() or not quotient or quotient.endswith("/")
        quotient += "/" if word == "per" else word if is_part else f"/{word}"
    texts = [quotient] + ["".join(words)] * all(len(word) > 1 for word in words)
    return next((text for text in texts if is_unit(text) or other_unit(text)), "")


def _is_letter_meant(letter: str, before: Sequence[str]) -> bool:
    """Whether one letter at the end of a name is a unit, by the quantities named before it."""
    named = {
        meaning
        for word in map(plain, before)
        for meaning in (SYMBOLS.get(word, ("",))[0], *_meanings().get(word, ()))
    }
    if letter in "va":
        return bool(before) and not named & NEITHER_V_NOR_A
    return bool(named & LETTER_UNITS.get(letter, frozenset()))


def _words_before_quantity(groups: Sequence[Sequence[str]]) -> int:
    """The number of words in a path such as esc/0/current before the group with the quantity."""
    for k in reversed(range(len(groups))):
        words = tuple(map(plain, groups[k]))
        found = {meaning for _, meanings in _phrases(words) for meaning in meanings}
        if found & QUANTITIES.keys() or any(word in SYMBOLS for word in words):
            return sum(map(len, groups[:k]))
    return 0


def _phrases(words: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Words and phrases, the longest first, with their meanings."""
    meanings = _meanings()
    k = 0
    while k < len(words):
        for count in range(min(LONGEST_PHRASE, len(words) - k), 0, -1):
            phrase = " ".join(words[k : k + count])
            if count == 1 or phrase in meanings:
                break
        is_mark = phrase in MOTOR_MARKS and words[k + 1 : k + 2] and words[k + 1].isdigit()
        yield phrase, ("motor",) if is_mark else meanings.get(phrase, ())
        k += count


def _sorted_words(stem: tuple[str, ...], n_before: int, unit: str) -> Name:
    """The name by the meanings of its words, of which the first `n_before` are a path."""
    found: set[str] = set()
    others: dict[str, str] = {}
    unknown: list[str] = []
    heads: list[str] = []
    symbols = []
    place = 0
    for phrase, meanings in _phrases(stem):
        is_in_path = place < n_before
        place += len(phrase.split())
        for meaning in meanings:
            is_meant = not is_in_path or meaning in GROUPS or phrase in GROUP_WORDS
            if meaning in OTHERS and is_meant:
                others[phrase] = meaning
        found |= set(meanings) - OTHERS.keys()
        if meanings or phrase.isdigit():
            continue
        if phrase in SYMBOLS:
            symbols.append(phrase)
        elif not is_in_path:
            follows = bool(symbols or found & QUANTITIES.keys())
            (heads if follows else unknown).append(phrase)
    quantities = frozenset(found & QUANTITIES.keys())
    symbol = symbols[0] if len(symbols) == 1 and not quantities else ""
    if quantities:  # vel_n
        heads += [symbol for symbol in symbols if quantities.isdisjoint(SYMBOLS[symbol])]
    elif len(symbols) > 1:
        unknown += symbols
    roles = frozenset(found & ROLES.keys())
    words = (*unknown, *heads)
    return Name(quantities, symbol, roles, others, words, tuple(heads), unit, stem)
