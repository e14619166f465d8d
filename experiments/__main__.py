"""Entry point of the command `infoset`: an interrupt while modules are loaded ends it like one during a computation."""

from __future__ import annotations

import sys

_DELAY_S = 0.05


def main() -> None:
    """Run the command `infoset`, and exit with its code.

    Raises
    ------
    SystemExit
        Always: 0 done, 1 a published number disagrees, 2 wrong input, 130 interrupted.

    Notes
    -----
    Only `sys` is imported before this `try`: an interrupt before it ends the process by the signal.
    """
    try:
        sys.unraisablehook = _repeat_interrupt
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


def _repeat_interrupt(unraisable: sys.UnraisableHookArgs) -> None:
    """Send the interrupt again if it fell into a callback of Python, which drops exceptions with a traceback."""
    import os
    import signal
    import threading

    if isinstance(unraisable.exc_value, KeyboardInterrupt) and os.name == "posix":
        # After a delay: an immediate signal would fall into this hook, which drops exceptions too.
        threading.Timer(_DELAY_S, os.kill, (os.getpid(), signal.SIGINT)).start()
    else:
        sys.__unraisablehook__(unraisable)


def _keep_exit_code() -> None:
    """Ignore interrupts while Python exits, and clear the mark of an interrupt that was handled before.

    Notes
    -----
    An interrupt inside code that Python compiles (the definition of a dataclass or a named tuple) is marked as not
    handled until the next such code. Under ``python -m`` the process then ends by the signal, whatever `SystemExit`
    says. Defining a named tuple clears the mark.
    """
    import signal
    from collections import namedtuple

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    namedtuple("_Nothing", ())


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether an error is an interrupt or has replaced one.

    Notes
    -----
    Python 3.11 names the interrupt as the cause while a module is loaded, pydantic only in the text of its own errors.
    """
    while error is not None and KeyboardInterrupt.__name__ not in repr(error):
        error = error.__cause__
    return error is not None


if __name__ == "__main__":
    main()
