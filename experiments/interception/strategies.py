"""Strategies and noises that options name: built in, or classes of Python files.

A class of a file is written as ``FILE.py:CLASS``.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import os
import re
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from infoset.experiments.common.errors import InputError, shown
from infoset.experiments.common.options import choice
from infoset.guidance import MeasurementNoise, NoiseKind, Strategy, strategy_names
from infoset.guidance.noise import NoiseSource
from infoset.sim import Scenario
from infoset.sim.scenario import strategy_name

NOISES = [kind.value for kind in NoiseKind]


def is_own(text: str) -> bool:
    """Whether the value of an option names a Python file, not a built-in strategy or noise."""
    return ":" in text or text.endswith(".py")


def own_strategy(text: str | None, option: str = "--strategy") -> Strategy | None:
    """Return the strategy of a Python file that an option names; None for a built-in name.

    `InputError` if the file has no such strategy.
    """
    if text is None or not is_own(text):
        return None
    return load_strategy(text, option)


def chosen_strategies(scenario: Scenario, names: str | None) -> Mapping[str, Strategy | None]:
    """Return the strategies of ``--strategies`` by name.

    A built-in strategy has the value None, a class of a Python file its object. The value None of
    the option means all built-in strategies. Raise `InputError` if there is no such strategy.
    """
    valid = strategy_names()
    texts = valid
    if names is not None:
        texts = [part.strip() for part in names.split(",")]
    chosen: dict[str, Strategy | None] = {}

    for text in texts:
        own = own_strategy(text, "--strategies")
        if own is None:
            chosen[choice("--strategies", text, valid)] = None
        else:
            chosen[strategy_name(scenario, own)] = own

    return chosen


def chosen_noise(text: str, names: Sequence[str] = NOISES) -> str | OwnNoise:
    """Return one of some names, or the noise of a Python file, which the option ``--noise`` names.

    `InputError` if there is no such noise.
    """
    return load_noise(text) if is_own(text) else choice("--noise", text, [*names, "FILE.py:CLASS"])


def chosen_noises(names: str) -> Mapping[str, NoiseSource | None]:
    """Return the noises of a comma-separated list by name.

    A built-in noise has the value None, a class of a Python file its object. `all` stands for all
    built-in ones, which come first; a repeated noise counts once. `InputError` if there is no such
    noise.
    """
    chosen: dict[str, NoiseSource | None] = {}
    parts = [part.strip() for part in names.split(",")]
    for text in [*(NOISES if "all" in parts else ()), *(part for part in parts if part != "all")]:
        noise = chosen_noise(text)
        chosen |= {noise: None} if isinstance(noise, str) else {noise.name: noise}
    return chosen


def load_strategy(text: str, option: str = "--strategy", version: str | None = None) -> Strategy:
    """Import a file and return a strategy of one of its classes, from a text ``FILE.py:CLASS``.

    The folder of the file is searched for the modules that it imports, after all other folders. The
    strategy is pickled as this text with its version: another process imports the same file, or
    refuses it. For this the class gets the attributes `version` and `__reduce__`.
    """
    kind, again = _load(text, option, ("start", "decide"), version)
    kind.version, kind.__reduce__ = again[2], lambda _self: (load_strategy, again)
    with own_code_errors():
        strategy: Strategy = kind()
    return strategy


def load_noise(text: str, option: str = "--noise", version: str | None = None) -> OwnNoise:
    """Import a file and return the noise of one of its classes, as `load_strategy` does."""
    return OwnNoise(*_load(text, option, ("measure",), version))


class OwnNoise:
    """The noise of a Python file: it makes an object of its class for each batch of runs."""

    def __init__(self, kind: Any, again: tuple[str, str, str]) -> None:
        self._kind = kind
        self._again = again
        self.version = again[2]
        self.name = f"{kind.__module__}.{kind.__qualname__}"

    def __reduce__(self) -> tuple[Any, ...]:
        return load_noise, self._again

    def __call__(self) -> MeasurementNoise:
        """Return the noise of a batch."""
        noise: MeasurementNoise = self._kind()
        return noise


_LOADED: dict[tuple[Path, str], str] = {}
"""The options that named the loaded classes, by file and name."""


def _load(
    text: str, option: str, methods: tuple[str, ...], version: str | None
) -> tuple[Any, tuple[str, str, str]]:
    """Return a class of a Python file, and what loads it in another process.

    The text is ``FILE.py:CLASS``. Another process needs the text, the option and the version.
    """
    name, _, class_name = text.rpartition(":")
    file = Path(name).resolve()
    if file.suffix != ".py" or not file.is_file():
        raise InputError(
            f"{option}: {shown(text)} must be FILE.py:CLASS, the path of a file that exists and "
            "its class"
        )

    # The newest class is the last one, which `own_code_errors` examines first.
    _LOADED.pop((file, class_name), None)
    _LOADED[file, class_name] = option
    with own_code_errors():
        if str(file.parent) not in sys.path:
            sys.path.append(str(file.parent))
        importlib.invalidate_caches()
        module = importlib.import_module(file.stem)

    if Path(module.__file__ or "").resolve() != file:
        raise InputError(
            f"{option}: {file.name} has the name of another Python module; rename the file"
        )

    # Kept by the module: the file may change after its import.
    digest = vars(module).setdefault(
        "_sha256_at_import", hashlib.sha256(file.read_bytes()).hexdigest()
    )

    kind = vars(module).get(class_name)
    if not (isinstance(kind, type) and all(hasattr(kind, method) for method in methods)):
        needed = "method" if len(methods) == 1 else "methods"
        raise InputError(
            f"{option}: {name} has no class {shown(class_name)} with the {needed} "
            f"{' and '.join(methods)}; check the name"
        )

    # 16 digits (64 bits) tell the versions of a file apart; chosen: a line shows them.
    found = f"{file.name}:{class_name} sha256:{digest[:16]}"
    if version not in (None, found):
        raise InputError(f"{option}: {text} has changed since the command started; run it again")
    return kind, (f"{file}:{class_name}", option, found)


@contextlib.contextmanager
def own_code_errors() -> Iterator[None]:
    """Turn an exception of the code in a loaded file into a message with its line.

    A wrong value that the code returned, or a class that needs arguments, gives a message without a
    line. Other exceptions pass.
    """
    try:
        yield
    except (InputError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        # A trace of another process is a part of it.
        trace = "".join(traceback.format_exception(error))
        for (file, name), option in reversed(_LOADED.items()):
            where = os.path.relpath(file)
            lines = re.findall(rf'File "{re.escape(str(file))}", line (\d+)', trace)
            if lines:
                where += f", line {lines[-1]}"
            elif not re.match(rf"((strategy|noise) )?{name}\b", str(error)):
                # Not an error of this class either, which has no line if the class needs
                # arguments, or returned a value that `infoset.sim` refuses.
                continue
            raise InputError(
                f"{option}: {where}: {type(error).__name__}: {error}; correct the file"
            ) from None
        raise
