"""Strategies that options name: built-in ones, and classes in Python files of the user (``FILE.py:CLASS``)."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import os
import sys
import traceback
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from experiments.common.errors import InputError, shown
from experiments.common.options import choice
from guidance import Situation, Strategy, strategy_names
from guidance.strategy import checked_impulses
from sim import Scenario
from sim.scenario import strategy_name


def is_own_strategy(text: str) -> bool:
    """Whether the value of ``--strategy`` names a Python file, not a built-in strategy."""
    return ":" in text or text.endswith(".py")


def own_strategy(text: str | None, option: str = "--strategy") -> Strategy | None:
    """Return the strategy of a Python file that an option names; None for a built-in name.

    `InputError` if the file has no such strategy.
    """
    return None if text is None or not is_own_strategy(text) else load_strategy(text, option)


def chosen_strategies(scenario: Scenario, names: str | None) -> Mapping[str, Strategy | None]:
    """Return the strategies of ``--strategies`` by name, with the strategy of a Python file, None for a built-in one.

    None is all built-in strategies. `InputError` if there is no such strategy, or one is named twice.
    """
    valid = strategy_names()
    chosen: dict[str, Strategy | None] = {}
    for text in valid if names is None else [part.strip() for part in names.split(",")]:
        own = own_strategy(text, "--strategies")
        name = choice("--strategies", text, valid) if own is None else strategy_name(scenario, own)
        if name in chosen:
            raise InputError(f"--strategies: {name} is named twice; name each strategy once")
        chosen[name] = own
    return chosen


def load_strategy(text: str, option: str = "--strategy", version: str | None = None) -> Strategy:
    """Import a file and return a strategy of one of its classes, from a text ``FILE.py:CLASS``.

    The folder of the file is searched for the modules that it imports. The errors of its code are `InputError`s. The
    strategy is pickled as this text with its version: another process imports the same file, or refuses it.
    """
    name, _, class_name = text.rpartition(":")
    file = Path(name).resolve()
    if file.suffix != ".py" or not file.is_file():
        raise InputError(f"{option}: {shown(text)} must be FILE.py:CLASS, with a file that exists; check the path")
    with _errors_of(file, option):
        if str(file.parent) not in sys.path:
            sys.path.append(str(file.parent))
        importlib.invalidate_caches()
        module = importlib.import_module(file.stem)
        if Path(module.__file__ or "").resolve() != file:
            raise InputError(f"{option}: {file.name} has the name of another Python module; rename the file")
        # Kept by the module: the file may change after its import.
        digest = vars(module).setdefault("_sha256_at_import", hashlib.sha256(file.read_bytes()).hexdigest())
        kind = vars(module).get(class_name)
        if not (isinstance(kind, type) and hasattr(kind, "start") and hasattr(kind, "decide")):
            raise InputError(
                f"{option}: {name} has no class {shown(class_name)} with the methods start and decide; check the name"
            )
        strategy = _reporting(kind, file, option, digest)
    if version not in (None, strategy.version):
        raise InputError(f"{option}: {text} has changed since the command started; run it again")
    return strategy  # type: ignore[no-any-return]


def _reporting(kind: Any, file: Path, option: str, digest: str) -> Any:
    """Return an object of a subclass, whose methods raise `InputError` with the line of an error in the file."""

    class Reporting(kind):  # type: ignore[misc]
        version = f"{file.name}:{kind.__name__} sha256:{digest[:16]}"

        def __reduce__(self) -> tuple[Any, ...]:
            return load_strategy, (f"{file}:{kind.__name__}", option, self.version)

        def start(self, shape: tuple[int, int]) -> Any:
            with _errors_of(file, option):
                return super().start(shape)

        def decide(self, situation: Situation, state: Any) -> Any:
            with _errors_of(file, option):
                wanted = super().decide(situation, state)
                return checked_impulses(wanted, situation, situation.predicted_miss.exists, self)

    Reporting.__module__, Reporting.__qualname__, Reporting.__name__ = kind.__module__, kind.__qualname__, kind.__name__
    return Reporting()


@contextlib.contextmanager
def _errors_of(file: Path, option: str) -> Iterator[None]:
    """Turn an exception of the code in a file into a message with its line."""
    try:
        yield
    except (InputError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == file]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        where = "" if line is None else f", line {line}"
        raise InputError(
            f"{option}: {os.path.relpath(file)}{where}: {type(error).__name__}: {error}; correct the file"
        ) from None
