"""What is said of the lines of a stream: each kind once, until lines come without it."""

from typing import TextIO

SILENCE = 100  # lines without a kind, after which it is said again


class Notes:
    """Notes on lines of a stream, by kind, written to `errors`."""

    def __init__(self, errors: TextIO):
        self._errors = errors
        self._last: dict[str, int] = {}  # line, by kind
        self._unsaid: dict[str, tuple[int, int]] = {}  # number of lines and the last, by kind

    def add(self, line_number: int, kind: str, text: str) -> None:
        """Write the note, or count it where its kind has been said of a line shortly before."""
        last = self._last.get(kind)
        self._last[kind] = line_number
        if last is not None and line_number - last <= SILENCE:
            count, _ = self._unsaid.get(kind, (0, 0))
            self._unsaid[kind] = count + 1, line_number
            return
        print(f"line {line_number}: {text}", file=self._errors)

    def close(self) -> None:
        """Say how often each kind was not said."""
        for kind, (count, last) in self._unsaid.items():
            where = f"{count} more lines" if count > 1 else "one more line"
            print(f"{kind}: in {where}, the last of them {last}", file=self._errors)
