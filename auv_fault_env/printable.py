"""Text from outside as it may be shown: on a terminal, in a file, on a page."""

import re

# control characters, marks that reverse the direction of text, and halves of a pair of UTF-16,
# which Python has in place of the bytes of a file name that are not UTF-8
UNPRINTABLE = re.compile(
    "[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]",
)
TAIL = " ..."


def printable(text: str, kept: str = "", longest: int | None = None) -> str:
    r"""The text with escapes in place of what a terminal obeys or no file can hold.

    Parameters
    ----------
    text
        From outside: a header, a file name, a message.
    kept
        Control characters that stay.
    longest
        Number of characters after which it is cut.

    >>> printable("u\x1b[2J\n"), printable("speed over ground", longest=9)
    ('u\\x1b[2J\\n', 'speed ...')
    """

    def escaped(match: re.Match) -> str:
        character = match[0]
        if character in kept:
            return character
        return character.encode("unicode_escape").decode()

    shown = UNPRINTABLE.sub(escaped, text)
    if longest is not None and len(shown) > longest:
        return shown[: longest - len(TAIL)] + TAIL
    return shown
