"""Kernels that most tests use, compiled once before the workers start.

Otherwise each worker compiles them, at the same time as the others.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from infoset.engine.section_passes import step_all
from infoset.kernels import cache_folder

STEP: Any = step_all
"""The kernel of a step of the engine: nearly all commands and tests use it."""
BESIDE_EACH_OTHER = (
    ("bound --budget 0", "engage dart-2022"),
    ("reach rendezvous-2021", "observe", "pursuit"),
)
"""Commands whose kernels are compiled in two processes at a time; together they take all kernels of
the engine, of polytopes and observers, and of the pursuit.
"""


def compile_first() -> None:
    """Compile the kernels, if the cache has none of the engine's."""
    folder = cache_folder(STEP.py_func)
    if folder is None or any(folder.glob("*.nbi")):
        return
    with ThreadPoolExecutor(len(BESIDE_EACH_OTHER)) as threads:
        list(threads.map(_run, BESIDE_EACH_OTHER))


def _run(commands: tuple[str, ...]) -> None:
    for command in commands:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(
                [sys.executable, "-m", "infoset", *command.split(), "--quiet"],
                cwd=folder,
                capture_output=True,
                check=False,  # a command that fails is found by the tests
            )
