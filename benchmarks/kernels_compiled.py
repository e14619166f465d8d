"""Count the kernels that each command compiles on an empty cache, and the processor time that the
cache saves.

    python -m benchmarks.kernels_compiled [COMMAND ...]

A specialisation is a kernel compiled for one set of argument types. The time is that of the first
run minus that of the second one, the shorter of two such pairs.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

COMMANDS = (
    "experiment",
    "experiment --model guaranteed",
    "experiment asteroid-1997-space --runs 5",
    "engage",
    "engage dart-2022",
    "campaign --runs 200 --out DIR",
    "bound",
    "adversary --budget 20",
    "reach rendezvous-2021",
    "pareto",
    "multipoint",
    "pursuit",
    "observe",
)
_COUNTED = """
import sys
from numba.core import event
from infoset.experiments.cli import main

class Count(event.Listener):
    kernels = []
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("infoset."):
            self.kernels.append(f"{function.__module__}.{function.__qualname__}")
    def on_end(self, event):
        pass

event.register("numba:compile", Count())
try:
    main(sys.argv[1:])
finally:
    print(len(set(Count.kernels)), len(Count.kernels), file=sys.stderr)
"""


def run(command: str, cache: str) -> tuple[list[int], float]:
    """Run a command; return the numbers of kernels and specialisations that it compiles, and its
    processor time, s.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        words = command.replace("DIR", str(Path(folder) / "out")).split()
        done = subprocess.run(
            [sys.executable, "-c", _COUNTED, *words, "--quiet"],
            cwd=folder,
            env={
                **os.environ,
                "NUMBA_CACHE_DIR": cache,
                "PYTHONPATH": str(Path(__file__).parents[1]),
            },
            capture_output=True,
            text=True,
            check=True,
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    elapsed_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [int(number) for number in done.stderr.splitlines()[-1].split()], elapsed_s


def main() -> None:
    """Print a row of a table for each command."""
    sys.stdout.write(
        "| command | kernels | specialisations | processor time to compile, s |\n"
        "|---|---|---|---|\n"
    )
    for command in sys.argv[1:] or COMMANDS:
        spent_s = []
        for _ in range(2):
            with tempfile.TemporaryDirectory() as cache:
                (kernels, specialisations), first_s = run(command, cache)
                spent_s.append(first_s - run(command, cache)[1])
        sys.stdout.write(f"| `{command}` | {kernels} | {specialisations} | {min(spent_s):.1f} |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
