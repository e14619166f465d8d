"""Errors of user input, and messages for the terminal."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterator, Sequence

LONGEST_SHOWN = 60
"""Maximum length of a value in a message; chosen: a message stays a few lines long."""
_LONGEST_WORD = 100
"""Number of letters of a word that are compared with the known names, none of which is as long: the
time of the comparison grows as the square of this number."""


def on_a_screen(message: str) -> str:
    """Return a message with a question mark for each unprintable character but line breaks.

    Parts of a message may come from a hostile file.
    """
    return "".join(letter if letter.isprintable() or letter == "\n" else "?" for letter in message)


class InputError(Exception):
    """Wrong user input; the message says what is wrong, where, and what to do.

    The command line prints it without a traceback and exits with code 2.
    """


@contextlib.contextmanager
def input_errors(
    source: str, remedy: str = "", kind: type[Exception] = ValueError
) -> Iterator[None]:
    """Turn an error into an `InputError`.

    Its message begins with the name of the file, option or problem, and ends with a remedy.
    """
    try:
        yield
    except kind as error:
        raise InputError(f"{source}: {error}{remedy}") from None


def shown(value: object) -> str:
    """Return a TOML value of any size and depth as a short text for a message."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        items = [
            "[...]" if isinstance(item, list) else shown(item) for item in value[:LONGEST_SHOWN]
        ]
        text = f"[{', '.join(items)}]"
    elif isinstance(value, str):
        letters = (c if c.isprintable() else "?" for c in value[: LONGEST_SHOWN + 1])
        text = f'"{"".join(letters)}"'
    else:
        text = str(value).lower().replace("infinity", "inf")

    if len(text) > LONGEST_SHOWN:
        return text[: LONGEST_SHOWN - 3] + "..."
    return text


def nearest(word: str, known: Sequence[str]) -> str | None:
    """Return the most similar known word; None if none is similar, or no word is known."""
    # 0.6 is the default of difflib.
    similar = difflib.get_close_matches(word[:_LONGEST_WORD], known, n=1, cutoff=0.6)
    return next(iter(similar), None)
