"""Decorators that compile kernels with Numba, the folder of the machine code, and the notice about compiling.

The name of the folder contains a hash of the sources that a kernel is compiled from, so stale machine code is never
loaded. Numba itself compares only the file that defines a kernel, not the files of the functions that it calls.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

from numba import config, njit, types
from numba.core import event
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import IRLegalization
from numba.core.typing.context import Context

F = TypeVar("F", bound=Callable[..., object])

JIT: Any = njit
CONFIG: Any = config
"""Numba's decorator and configuration, with the options that their types leave out."""
PACKAGES = ("infoset", "guidance", "sim", "rendezvous")
VARIABLE = "NUMBA_CACHE_DIR"
LOGGER = logging.getLogger("infoset.kernels")
"""Logger of the notice; without any configuration of logging it is printed on stderr."""
NOTICE_AFTER_S = 1.0

_IMPORT = re.compile(rf"^\s*from ((?:{'|'.join(PACKAGES)})[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)


class Kernels:
    """Decorators that compile the kernels of a package: without the GIL, divisions unchecked as in C.

    `fastmath` has the liberties that LLVM may take with floating-point numbers.
    """

    def __init__(self, *fastmath: str) -> None:
        # Without the wrapper for C, which is not used, compilation is shorter; but where a product and a sum may become
        # one operation (`contract`), LLVM joins others then, and the last digits of results change.
        exact = "contract" not in fastmath
        self._options = {"nogil": True, "error_model": "numpy", "fastmath": set(fastmath), "no_cfunc_wrapper": exact}

    def compiled(self, function: F) -> F:
        """Compile a kernel that may allocate arrays; its machine code is stored on disk."""
        return self._stored(function, {})

    def entry(self, function: F) -> F:
        """Compile a kernel that allocates no array, nor does anything it calls; its machine code is stored on disk.

        Without Numba's atomic reference counts, which may cost more than the work.
        """
        return self._stored(function, {"_nrt": False})

    def allocation_free(self, function: F) -> F:
        """Compile a kernel that allocates no array and is called by other kernels, which are stored with it."""
        return self._linked(function, {})

    def inlined(self, function: F) -> F:
        """Compile a small `allocation_free` kernel that is inlined wherever it is called."""
        return self._linked(function, {"forceinline": True})

    def _stored(self, function: F, options: dict[str, object]) -> F:
        folder = cache_folder(function)
        before = CONFIG.CACHE_DIR
        try:
            CONFIG.CACHE_DIR = "" if folder is None else str(folder)
            stored = JIT(cache=folder is not None, pipeline_class=_Compiler, **self._options, **options)
            return cast(F, stored(function))
        finally:
            CONFIG.CACHE_DIR = before

    def _linked(self, function: F, options: dict[str, object]) -> F:
        kernel: Any = JIT(
            _nrt=False,
            no_cpython_wrapper=True,
            pipeline_class=_LinkedCompiler,
            **self._options,
            **options,
        )(function)
        if kernel is not function:  # it is the function itself under NUMBA_DISABLE_JIT
            kernel._insert = lambda *_, **__: None
            kernel._compile_for_args = lambda *_, **__: _callable_from_python(kernel)
        return cast(F, kernel)


@cache
def _callable_from_python(kernel: Any) -> Any:
    """Return a compiled function that calls a linked kernel, which has no code that Python could call."""
    return JIT(lambda *arguments: kernel(*arguments))  # noqa: PLW0108 - the kernel has no Python interface


class _Typing(Context):
    """Numba's typing, except that a built-in function is looked up once for each type of its arguments.

    Numba tries all definitions of an operator at each use, also those for texts, lists and sets: a tenth of the time.
    Definitions that Numba compiles inherit the fast-math options of the kernel.
    """

    _signatures: ClassVar[dict[tuple[Any, ...], Any]] = {}

    def __init__(self, context: Any) -> None:
        self.__dict__ = context.__dict__

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a function for some types of arguments; None if there is none."""
        if type(func) is not types.Function or kws:
            return super().resolve_function_type(func, args, kws)
        key = frozenset(ConfigStack().top().fastmath.flags), func, tuple(args)
        if key not in self._signatures:
            signature = super().resolve_function_type(func, args, kws)
            if signature is None:
                return None
            self._signatures[key] = signature
        return self._signatures[key]


@cache
def _typing_of(context: Any) -> _Typing:
    return _Typing(context)


@cache
def _internal_functions(_fastmath: frozenset[str]) -> dict[Any, Any]:
    """Return Numba's store of the functions that it compiles for kernels with these fast-math options, such as powers.

    Numba has one store for all options, so that the digits of a kernel would depend on the kernels compiled before.
    """
    return {}


class _Compiler(CompilerBase):
    """Numba's compiler with faster typing."""

    def __init__(self, typing: Any, *arguments: Any) -> None:
        super().__init__(_typing_of(typing), *arguments)
        self.state.targetctx.cached_internal_func = _internal_functions(frozenset(self.state.flags.fastmath.flags))

    def define_pipelines(self) -> list[Any]:
        """Return Numba's passes."""
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


class _LinkedLibrary(JITCodeLibrary):
    """Code that is only linked into that of other kernels: optimised and translated to machine code there, not here."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, _name: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> _LinkedLibrary:
        return self

    def set_env(self, _name: str, _environment: object) -> None:
        """Leave the environment unset: only object mode and exceptions use it, and linked kernels have neither."""


@register_pass(mutates_CFG=False, analysis_only=True)
class _UseLinkedLibrary(AnalysisPass):
    """Lower a kernel into a `_LinkedLibrary`."""

    _name = "use_linked_library"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """Set the library, which the lowering would otherwise create."""
        state.library = _LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return True


class _LinkedCompiler(_Compiler):
    """A compiler whose code goes into a `_LinkedLibrary`."""

    def define_pipelines(self) -> list[Any]:
        """Return Numba's passes with one more."""
        (passes,) = super().define_pipelines()
        passes.add_pass_after(_UseLinkedLibrary, IRLegalization)
        passes.finalize()
        return [passes]


def cache_folder(kernel: Callable[..., object]) -> Path | None:
    """Return the folder for the machine code of a kernel's module; None if no folder can be written.

    The folder is in NUMBA_CACHE_DIR, else in the user's cache folder, else in a private folder for temporary files:
    machine code must not come from a folder in which other users can write.
    """
    module, file = kernel.__module__, Path(kernel.__code__.co_filename)
    try:
        name = f"{module}-{_hash_of_sources(file.parents[module.count('.')], file)}"
    except (OSError, IndexError):  # a function without a source file
        return None
    roots: list[Callable[[], Path]] = [_user_folder, _private_folder]
    if os.environ.get(VARIABLE):
        roots.insert(0, lambda: Path(os.environ[VARIABLE]))
    for root in roots:
        try:
            folder = root() / name
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    return None


def _user_folder() -> Path:
    """Return the folder for caches of this user and project; OSError if the user has no home."""
    try:
        home = Path.home()
    except RuntimeError as error:
        raise FileNotFoundError("the user has no home folder") from error
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "infoset"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "infoset" / "Cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "infoset"


def _private_folder() -> Path:
    """Return a folder for temporary files that belongs to this user alone; make it if it does not exist."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"infoset-kernels-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    shared = hasattr(os, "getuid") and (status.st_uid != user or status.st_mode & 0o077)
    if not stat.S_ISDIR(status.st_mode) or shared:
        raise PermissionError(f"{folder} belongs to another user")
    return folder


def _hash_of_sources(root: Path, file: Path) -> str:
    """Return a hash of a source file and of all files of the project that it imports, directly or not."""
    digest, files, queue = hashlib.sha256(), {file}, [file]
    for source in queue:
        new = [path for path in _imports(root, source) if path not in files]
        files.update(new)
        queue.extend(new)
    for source in sorted(files):
        digest.update(_text(source).encode())
    return digest.hexdigest()[:16]


@cache
def _imports(root: Path, file: Path) -> tuple[Path, ...]:
    """Return the files of the project that a source file imports."""
    return tuple(
        path
        for package, names in _IMPORT.findall(_text(file))
        for path in _modules(root / package.replace(".", "/"), names)
    )


def _modules(package: Path, names: str) -> Iterator[Path]:
    """Yield the files of what is imported from a module or a package."""
    if package.is_dir():
        modules = [package / f"{name}.py" for name in re.findall(r"\w+", names)]
        existing = [path for path in modules if path.exists()]
        yield from existing
        if len(existing) < len(modules):
            yield package / "__init__.py"
    else:
        yield package.with_suffix(".py")


@cache
def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")


class _Compilation(event.Listener):
    """What happens during a compilation: no garbage collection, and one notice in a process that compiles for long.

    Garbage collection would take a tenth of the time: the compiler makes many objects, and most of them stay.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._began = self._spent_s = 0.0
        self._given = self._collecting = False

    def on_start(self, event: Any) -> None:
        """Begin to count at the outermost compilation."""
        if self._depth == 0:
            self._began = time.monotonic()
            self._collecting = gc.isenabled()
            gc.disable()
        self._depth += 1
        self._give(event)

    def on_end(self, event: Any) -> None:
        """Add the time of the outermost compilation."""
        self._depth -= 1
        self._give(event)
        if self._depth == 0:
            self._spent_s += time.monotonic() - self._began
            if self._collecting:
                gc.enable()

    def _give(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        spent_s = self._spent_s + time.monotonic() - self._began
        if self._given or spent_s < NOTICE_AFTER_S or not function.__module__.startswith(PACKAGES):
            return
        self._given = True
        folder = cache_folder(function)
        if folder is None:
            how = f"in every process, because no cache folder can be written: set {VARIABLE} to a folder that can"
        else:
            how = f"for this and later runs; the machine code is stored in {folder.parent}"
        LOGGER.warning("compiling the numerical kernels (about 5 to 15 s), %s", how)


event.register("numba:compile", _Compilation())
