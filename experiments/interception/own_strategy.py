"""Strategies in a Python file of the user: ``--strategy FILE.py:CLASS``."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from experiments.common.errors import InputError, input_errors, nearest, shown
from guidance import Situation, Strategy
from guidance.strategy import check_axes, checked_impulses
from sim import Scenario

METHODS = ("start", "decide")
_hashes: dict[Path, str] = {}
"""Hash of each file as it was imported: like the modules themselves, one for the process."""


def is_own_strategy(text: str) -> bool:
    """Whether the value of ``--strategy`` names a Python file, not a built-in strategy."""
    return ":" in text or text.endswith(".py")


def own_strategy(text: str | None, scenario: Scenario, option: str = "--strategy") -> Strategy | None:
    """Return the strategy that ``--strategy FILE.py:CLASS`` names; None for a built-in name.

    Raise `InputError` if the file has no such strategy, its code raises an exception, or it decides for both lateral
    axes and the scenario is in a plane.
    """
    if text is None or not is_own_strategy(text):
        return None
    own = load_strategy(text, option)
    with input_errors(f"{option}: {text}"):
        check_axes(own, scenario.set_model.axes)
    return own


def load_strategy(text: str, option: str = "--strategy") -> Strategy:
    """Import a file and create a strategy of one of its classes, from a text ``FILE.py:CLASS``.

    The strategy can be pickled: another process imports the file again. Its module is named after the file, and the
    folder of the file is searched for the modules that it imports, as by ``python FILE.py``. Raise `InputError` if
    there is no such file or class, the class is not a `Strategy`, or the code of the file raises an exception. The
    methods of the strategy raise it too, instead of the exceptions of the file.
    """
    name, _, class_name = text.rpartition(":") if ":" in text else (text, "", "")
    file = Path(name)
    if file.suffix != ".py":
        raise InputError(f"{option}: {shown(name)} must be a Python file; for example {option} mine.py:Mine")
    if not file.is_file():
        raise InputError(f"{option}: there is no file {shown(name)}; check the path")
    module_file = file.resolve()
    module = _imported(module_file, option)
    classes = [
        key for key, value in vars(module).items() if _is_strategy(value) and value.__module__ == module.__name__
    ]
    if not class_name:
        raise InputError(f"{option}: name a class of {name}, for example {option} {name}:{(*classes, 'Mine')[0]}")
    kind = vars(module).get(class_name)
    if not isinstance(kind, type):
        guess = nearest(class_name, classes) or next(iter(classes), None)
        hint = f"did you mean {name}:{guess}?" if guess else "define it there, or check the name"
        raise InputError(f"{option}: {name} has no class {shown(class_name)}; {hint}")
    if not _is_strategy(kind):
        raise InputError(f"{option}: {name}:{class_name} is not a strategy; define its methods start and decide")
    with _reporting(module_file, option):
        return _guarded(kind, module_file, option)


def _load_same(text: str, option: str, version: str) -> Strategy:
    """Load a strategy in another process; refuse a file that has changed since the first process imported it."""
    strategy = load_strategy(text, option)
    if strategy.version != version:  # type: ignore[attr-defined]
        raise InputError(f"{option}: {text} has changed since the command started; run it again")
    return strategy


def _is_strategy(value: object) -> bool:
    return isinstance(value, type) and all(callable(getattr(value, method, None)) for method in METHODS)


def _imported(file: Path, option: str) -> ModuleType:
    name = file.stem
    known = sys.modules.get(name)
    if known is not None and Path(known.__file__ or "") == file:
        return known
    other = importlib.util.find_spec(name) if name.isidentifier() else None
    if known is not None or "." in name or (other is not None and Path(other.origin or "").resolve() != file):
        raise InputError(f"{option}: {file.name} has the name of another Python module; rename the file")
    content = file.read_bytes()
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    sys.path.append(str(file.parent))
    try:
        with _reporting(file, option):
            spec.loader.exec_module(module)
        _hashes[file] = hashlib.sha256(content).hexdigest()[:16]
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _guarded(kind: Any, file: Path, option: str) -> Strategy:
    """Return a strategy of a subclass that reports the exceptions of the file, and is pickled by its path."""
    if file not in _hashes:  # imported by other means than this module
        _hashes[file] = hashlib.sha256(file.read_bytes()).hexdigest()[:16]

    class Guarded(kind):  # type: ignore[misc]
        version = f"{file.name}:{kind.__name__} sha256:{_hashes[file]}"

        def __reduce__(self) -> tuple[Any, ...]:
            return _load_same, (f"{file}:{kind.__name__}", option, self.version)

        def start(self, batch: int) -> Any:
            with _reporting(file, option):
                return super().start(batch)

        def decide(self, situation: Situation, state: Any) -> Any:
            with _reporting(file, option):
                wanted = super().decide(situation, state)
                return checked_impulses(wanted, situation, situation.predicted_miss.exists, self)

    Guarded.__module__, Guarded.__qualname__, Guarded.__name__ = kind.__module__, kind.__qualname__, kind.__name__
    strategy: Strategy = Guarded()
    return strategy


@contextlib.contextmanager
def _reporting(file: Path, option: str) -> Iterator[None]:
    """Turn an exception of the code in a file into a message with its line."""
    try:
        yield
    except (InputError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == file]
        if isinstance(error, SyntaxError):
            lines = [error.lineno]
        where = f", line {lines[-1]}" if lines else ""
        raise InputError(
            f"{option}: {os.path.relpath(file)}{where}: {type(error).__name__}: {error}; correct the file"
        ) from None
