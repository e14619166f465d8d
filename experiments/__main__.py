"""The command `infoset` from its first moment: an interrupt while modules are loaded ends it as one during a flight."""

from __future__ import annotations

import sys

_MOMENT_S = 0.05


def main() -> None:
    """Run the command `infoset`, and exit with its code.

    Raises
    ------
    SystemExit
        Always: 0 done, 2 wrong input, 130 interrupted.

    Notes
    -----
    Only `sys` is imported before this `try`: an interrupt before it ends the process by the signal.
    """
    try:
        sys.unraisablehook = _lose_no_interrupt
        import atexit

        atexit.register(_keep_exit_code)
        from experiments.cli import main as run

        run()
    except (KeyboardInterrupt, Exception) as error:
        if not _is_interrupt(error):
            raise
        from experiments.common.errors import INTERRUPTED

        sys.stderr.write("interrupted\n")
        sys.exit(INTERRUPTED)


def _lose_no_interrupt(unraisable: sys.UnraisableHookArgs) -> None:
    """Interrupt again where an interrupt fell into a callback of Python's own, which would drop it with a traceback."""
    import os
    import signal
    import threading

    if isinstance(unraisable.exc_value, KeyboardInterrupt) and os.name == "posix":
        # A moment later: at once it would fall into this hook, and be dropped too.
        threading.Timer(_MOMENT_S, os.kill, (os.getpid(), signal.SIGINT)).start()
    else:
        sys.__unraisablehook__(unraisable)


def _keep_exit_code() -> None:
    """Let no interrupt replace the exit code: none that comes while Python exits, and none that was handled before.

    Notes
    -----
    An interrupt inside text that Python runs (a dataclass or a named tuple that is being defined) is remembered as not
    handled until the next such text. Under ``python -m`` the process then ends by the signal, whatever `SystemExit`
    says. Defining a named tuple clears it.
    """
    import signal
    from collections import namedtuple

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    namedtuple("_Nothing", ())


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether an error is an interrupt, or what Python 3.11 makes of one while a module is loaded: another's cause."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


if __name__ == "__main__":
    main()
