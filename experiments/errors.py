"""What went wrong, said to a person."""

from __future__ import annotations


class InputError(Exception):
    """Something a person gave is wrong; the message says what, where, and what to do.

    The command line prints it without a traceback and exits with code 2.
    """
