"""Decorators that compile kernels with Numba, and the notice about compiling.

The machine code is stored in a folder. The name of the folder contains a hash of the sources that a
kernel is compiled from, so stale machine code is never loaded. Numba itself compares only the file
that defines a kernel, not the files of the functions that it calls.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from numba import config, njit
from numba.core import event

F = TypeVar("F", bound=Callable[..., object])

JIT: Any = njit
CONFIG: Any = config
"""Numba's decorator and configuration, with the options that their types leave out."""
HERE = Path(__file__).parent
"""Folder of the package."""
BESIDE = ("guidance", "sim", "rendezvous", "experiments")
"""Packages of the project whose folders are beside this one in a checkout, and inside it in an
installation.
"""
VARIABLE = "NUMBA_CACHE_DIR"
"""Numba's variable for the folder of the machine code."""
LOGGER = logging.getLogger("infoset.kernels")
"""Logger of the notice; without any configuration of logging it is printed on stderr."""

_IMPORT = re.compile(r"^\s*from (infoset(?:\.\w+)*) import (\([^)]*\)|.*)", re.MULTILINE)


class Kernels:
    """Decorators that compile the kernels of a package.

    Kernels run without the GIL, and divide by zero without an error, as in C. `fastmath` has the
    liberties that LLVM may take with floating-point numbers.
    """

    def __init__(self, *fastmath: str) -> None:
        # Nothing needs the function that Numba writes to call a kernel from C.
        self._options = {
            "nogil": True,
            "error_model": "numpy",
            "fastmath": set(fastmath),
            "no_cfunc_wrapper": True,
        }
        self._inner_options = {**self._options, "_nrt": False, "no_cpython_wrapper": True}

    def compiled(self, function: F) -> F:
        """Compile a kernel that may allocate arrays; its machine code is stored on disk."""
        return self._stored(function)

    def entry(self, function: F) -> F:
        """Compile a kernel that allocates no array, nor does anything it calls.

        Its machine code is stored on disk. It has no atomic reference counts of Numba, which may
        cost more than the work.
        """
        return self._stored(function, _nrt=False)

    def allocation_free(self, function: F) -> F:
        """Compile a kernel that allocates no array and that only kernels call.

        It is stored with these kernels. Numba writes no function to call it from Python, which
        would be a quarter of the time to compile: a call from Python crashes the process. Tests
        call it through `tests.kernels`.
        """
        kernel: F = JIT(**self._inner_options)(function)
        return kernel

    def inlined(self, function: F) -> F:
        """Compile a small `allocation_free` kernel that is inlined wherever it is called."""
        kernel: F = JIT(forceinline=True, **self._inner_options)(function)
        return kernel

    def pasted(self, function: F) -> F:
        """Paste a kernel into the code of those that call it, before it is compiled.

        For kernels that return addresses of records in a tuple, which a compiled function cannot,
        and for a large one that is called in one place, which would be compiled twice.
        """
        kernel: F = JIT(inline="always", **self._inner_options)(function)
        return kernel

    def _stored(self, function: F, **options: object) -> F:
        folder = cache_folder(function)
        before = CONFIG.CACHE_DIR
        CONFIG.CACHE_DIR = str(folder or "")
        try:
            kernel: F = JIT(cache=folder is not None, **self._options, **options)(function)
        finally:
            CONFIG.CACHE_DIR = before
        return kernel


def cache_folder(kernel: Callable[..., object]) -> Path | None:
    """Return the folder for the machine code of a kernel's module; None if it cannot be written.

    It is in NUMBA_CACHE_DIR, else in the user's cache folder: machine code must not come from a
    folder in which other users can write.
    """
    module = kernel.__module__
    file = Path(kernel.__code__.co_filename)
    try:
        root = Path(os.environ.get(VARIABLE) or _user_folder())
        folder = root / f"{module}-{_hash_of_sources(file)}"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        # A read-only folder, a user without a home, code without a file.
        return None
    return folder if os.access(folder, os.W_OK) else None


def _user_folder() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "infoset"


def _hash_of_sources(file: Path) -> str:
    """Return a hash of a source file and of all files that it imports, directly or not.

    Only files of the project count. The texts are in the order of their contents, so that it does
    not depend on the folder of the project.
    """
    files = [file]
    for source in files:
        files += [path for path in _imports(source) if path not in files]
    # 16 digits are 64 bits: enough to tell versions apart, in the short name of a file.
    return hashlib.sha256("".join(sorted(map(_text, files))).encode()).hexdigest()[:16]


@cache
def _imports(file: Path) -> tuple[Path, ...]:
    """Return the files of the project that a source file imports."""
    imports = _IMPORT.findall(_text(file))
    paths = [path for package, names in imports for path in _modules(_path_of(package), names)]
    return tuple(dict.fromkeys(paths))


def _path_of(module: str) -> Path:
    """Return the folder of a package, or the file of a module without its suffix."""
    _, *names = module.split(".")
    is_beside = bool(names) and names[0] in BESIDE and not (HERE / names[0]).is_dir()
    root = HERE.parent if is_beside else HERE
    return root.joinpath(*names)


def _modules(package: Path, names: str) -> Iterator[Path]:
    """Yield the files that define names which are imported from a module or a package."""
    if not package.is_dir():
        yield package.with_suffix(".py")
        return
    for name in re.findall(r"\w+", names):
        module = package / f"{name}.py"
        yield module if module.exists() else package / "__init__.py"


@cache
def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


@dataclass
class _Compiled:
    """The kernels that a command has compiled, by their modules, and the time that it took."""

    modules: list[str] = field(default_factory=list)
    elapsed_s: float = 0.0

    def text(self, of_what: str) -> str:
        """Return one line about them."""
        count = len(self.modules)
        kernels = "kernel" if count == 1 else "kernels"
        packages = sorted({".".join(module.split(".")[:2]) for module in self.modules})
        listed = ", ".join(packages)
        return f"compiled {count} {kernels}{of_what} in {self.elapsed_s:.1f} s ({listed})"


class CompileNotice(event.Listener):
    """The notice about compiling, and the summary after it.

    The notice is one line at the first kernel of a command or a process, the summary one line at
    the end of a command. Numba holds a lock while it compiles a kernel and, within it, those that
    it calls.
    """

    def __init__(self) -> None:
        self.purpose = ""
        self._compiled = _Compiled()
        self._depth = 0
        self._began_s = 0.0

    def on_start(self, event: Any) -> None:
        """Count a kernel that is compiled; give the notice at the first one."""
        function = event.data["dispatcher"].py_func
        if not function.__module__.startswith("infoset."):
            return
        if self._depth == 0:
            self._began_s = time.perf_counter()
        self._depth += 1
        self._compiled.modules.append(function.__module__)
        if len(self._compiled.modules) == 1:
            self._announce(cache_folder(function))

    def on_end(self, event: Any) -> None:
        """Add the time of a kernel that Python called.

        It contains the time of the kernels within it.
        """
        function = event.data["dispatcher"].py_func
        if not function.__module__.startswith("infoset."):
            return
        self._depth -= 1
        if self._depth == 0:
            self._compiled.elapsed_s += time.perf_counter() - self._began_s

    @contextlib.contextmanager
    def of(self, purpose: str) -> Iterator[None]:
        """Name the purpose of the kernels that are compiled within the context.

        At the end, a summary says which were compiled and how long it took; none if no kernel was
        compiled, or after an exception.
        """
        self.purpose = purpose
        self._compiled = _Compiled()
        try:
            yield
            if self._compiled.modules:
                LOGGER.warning("%s", self._compiled.text(self._of_what()))
        finally:
            self.purpose = ""

    @property
    def is_given(self) -> bool:
        """Whether the notice of this command has been given."""
        return bool(self._compiled.modules)

    def _announce(self, folder: Path | None) -> None:
        if folder is None:
            how = (
                f"in every process, because the cache folder cannot be written: set {VARIABLE} to "
                "a folder that can"
            )
        else:
            how = f"once; later runs load the machine code from {folder.parent}"
        LOGGER.warning(
            "compiling the numerical kernels%s (up to a minute), %s", self._of_what(), how
        )

    def _of_what(self) -> str:
        return f" of {self.purpose}" if self.purpose else ""


NOTICE = CompileNotice()
"""The notice of this process."""

event.register("numba:compile", NOTICE)
