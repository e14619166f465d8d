"""The command `infoset` from its first moment: interrupted while Python still loads it, it leaves as later on."""

from __future__ import annotations

import sys

INTERRUPTED = 130


def main() -> None:
    """Run the command `infoset`, and leave with its exit code.

    Raises
    ------
    SystemExit
        Always: 0 done, 2 something given is wrong, 130 interrupted.
    """
    try:
        from experiments.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
