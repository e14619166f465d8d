"""What went wrong, said to a person."""

from __future__ import annotations

INTERRUPTED = 130
"""Exit code, as of a program that Ctrl-C ends."""


def on_a_screen(message: str) -> str:
    """Return a message without what would steer the terminal: parts of it may come from somebody else's file.

    Returns
    -------
    str
        The same lines, with a question mark for each character that cannot be printed.
    """
    return "".join(each if each.isprintable() or each == "\n" else "?" for each in message)


class InputError(Exception):
    """Something a person gave is wrong; the message says what, where, and what to do.

    The command line prints it without a traceback and exits with code 2.
    """
