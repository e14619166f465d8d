"""The command `infoset`, and ``python -m infoset``."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command `infoset`.

    An interrupt while its modules are loaded ends it with code 130 too.
    """
    try:
        from infoset.experiments.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
