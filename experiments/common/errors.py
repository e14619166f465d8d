"""Errors of user input, and messages for the terminal."""

from __future__ import annotations

INTERRUPTED = 130
"""Exit code of a program that Ctrl-C ends."""


def on_a_screen(message: str) -> str:
    """Return a message with a question mark for each unprintable character: parts may come from a hostile file."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "?" for letter in message)


class InputError(Exception):
    """Wrong user input; the message says what is wrong, where, and what to do.

    The command line prints it without a traceback and exits with code 2.
    """
