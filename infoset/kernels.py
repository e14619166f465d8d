"""Decorators that compile kernels with Numba, the folder of the machine code, and the notice about compiling.

The name of the folder contains a hash of the sources that a kernel is compiled from, so stale machine code is never
loaded. Numba itself compares only the file that defines a kernel, not the files of the functions that it calls.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from numba import config, njit
from numba.core import event

F = TypeVar("F", bound=Callable[..., object])

JIT: Any = njit
CONFIG: Any = config
"""Numba's decorator and configuration, with the options that their types leave out."""
PACKAGES = ("infoset", "guidance", "sim", "rendezvous")
VARIABLE = "NUMBA_CACHE_DIR"
LOGGER = logging.getLogger("infoset.kernels")
"""Logger of the notice; without any configuration of logging it is printed on stderr."""

_IMPORT = re.compile(rf"^\s*from ((?:{'|'.join(PACKAGES)})[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)


class Kernels:
    """Decorators that compile the kernels of a package: without the GIL, divisions unchecked as in C.

    `fastmath` has the liberties that LLVM may take with floating-point numbers.
    """

    def __init__(self, *fastmath: str) -> None:
        # Nothing needs the function that Numba writes to call a kernel from C.
        options = {"nogil": True, "error_model": "numpy", "fastmath": set(fastmath), "no_cfunc_wrapper": True}
        self._options = options
        self._inner_options = {**options, "_nrt": False, "no_cpython_wrapper": True}

    def compiled(self, function: F) -> F:
        """Compile a kernel that may allocate arrays; its machine code is stored on disk."""
        return self._stored(function)

    def entry(self, function: F) -> F:
        """Compile a kernel that allocates no array, nor does anything it calls; its machine code is stored on disk.

        Without Numba's atomic reference counts, which may cost more than the work.
        """
        return self._stored(function, _nrt=False)

    def allocation_free(self, function: F) -> F:
        """Compile a kernel that allocates no array and that only kernels call; it is stored with them.

        Numba writes no function to call it from Python, which would be a quarter of the time to compile: a call from
        Python crashes the process. Tests call it through `tests.kernels`.
        """
        kernel: F = JIT(**self._inner_options)(function)
        return kernel

    def inlined(self, function: F) -> F:
        """Compile a small `allocation_free` kernel that is inlined wherever it is called."""
        kernel: F = JIT(forceinline=True, **self._inner_options)(function)
        return kernel

    def pasted(self, function: F) -> F:
        """Paste a kernel into the code of those that call it, before it is compiled.

        For kernels that return addresses of records in a tuple, which a compiled function cannot, and for a large one
        that is called in one place, which would be compiled twice.
        """
        kernel: F = JIT(inline="always", **self._inner_options)(function)
        return kernel

    def _stored(self, function: F, **options: object) -> F:
        folder, before = cache_folder(function), CONFIG.CACHE_DIR
        CONFIG.CACHE_DIR = str(folder or "")
        try:
            kernel: F = JIT(cache=folder is not None, **self._options, **options)(function)
        finally:
            CONFIG.CACHE_DIR = before
        return kernel


def cache_folder(kernel: Callable[..., object]) -> Path | None:
    """Return the folder for the machine code of a kernel's module; None if it cannot be written.

    It is in NUMBA_CACHE_DIR, else in the user's cache folder: machine code must not come from a folder in which other
    users can write.
    """
    module, file = kernel.__module__, Path(kernel.__code__.co_filename)
    try:
        root = Path(os.environ.get(VARIABLE) or _user_folder())
        folder = root / f"{module}-{_hash_of_sources(file.parents[module.count('.')], file)}"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError, IndexError):  # a read-only folder, a user without a home, code without a file
        return None
    return folder if os.access(folder, os.W_OK) else None


def _user_folder() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "infoset"


def _hash_of_sources(root: Path, file: Path) -> str:
    """Return a hash of a source file and of all files of the project that it imports, directly or not."""
    files = [file]
    for source in files:
        files += [path for path in _imports(root, source) if path not in files]
    return hashlib.sha256("".join(map(_text, sorted(files))).encode()).hexdigest()[:16]


@cache
def _imports(root: Path, file: Path) -> tuple[Path, ...]:
    """Return the files of the project that a source file imports."""
    return tuple(
        dict.fromkeys(
            path
            for package, names in _IMPORT.findall(_text(file))
            for path in _modules(root / package.replace(".", "/"), names)
        )
    )


def _modules(package: Path, names: str) -> Iterator[Path]:
    """Yield the files of what is imported from a module or a package."""
    if package.is_dir():
        modules = [package / f"{name}.py" for name in re.findall(r"\w+", names)]
        yield from (path if path.exists() else package / "__init__.py" for path in modules)
    else:
        yield package.with_suffix(".py")


@cache
def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


class _Notice(event.Listener):
    """One notice in a process that compiles kernels."""

    given = False

    def on_start(self, event: Any) -> None:
        """Give the notice at the first kernel that is compiled."""
        function = event.data["dispatcher"].py_func
        if self.given or not function.__module__.startswith(PACKAGES):
            return
        self.given = True
        folder = cache_folder(function)
        if folder is None:
            how = f"in every process, because the cache folder cannot be written: set {VARIABLE} to a folder that can"
        else:
            how = f"for this and later runs; the machine code is stored in {folder.parent}"
        LOGGER.warning("compiling the numerical kernels (up to about 25 s), %s", how)

    def on_end(self, event: Any) -> None:
        """Do nothing."""


event.register("numba:compile", _Notice())
