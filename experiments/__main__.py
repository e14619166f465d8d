"""The command `infoset` from its first moment: interrupted while Python still loads it, it leaves as later on."""

from __future__ import annotations

import os
import signal
import sys
import threading

from experiments.errors import INTERRUPTED

_MOMENT_S = 0.05


def main() -> None:
    """Run the command `infoset`, and leave with its exit code.

    Raises
    ------
    SystemExit
        Always: 0 done, 2 something given is wrong, 130 interrupted.
    """
    sys.unraisablehook = _lose_no_interrupt
    try:
        from experiments.cli import main as run

        run()
    except (KeyboardInterrupt, Exception) as error:
        if not _is_interrupt(error):
            raise
        sys.stderr.write("interrupted\n")
        sys.exit(INTERRUPTED)


def _lose_no_interrupt(unraisable: sys.UnraisableHookArgs) -> None:
    """Interrupt again where an interrupt fell into a callback of Python's own, which would drop it with a traceback."""
    if isinstance(unraisable.exc_value, KeyboardInterrupt) and os.name == "posix":
        # A moment later: at once it would fall into this hook, and be dropped too.
        threading.Timer(_MOMENT_S, os.kill, (os.getpid(), signal.SIGINT)).start()
    else:
        sys.__unraisablehook__(unraisable)


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether an error is an interrupt, or what Python 3.11 makes of one while a module is loaded: another's cause."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


if __name__ == "__main__":
    main()
