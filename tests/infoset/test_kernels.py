"""The notice about compiling: one at the beginning of a command and one at its end."""

from __future__ import annotations

import ast
import logging
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import infoset.guidance
import infoset.rendezvous
import infoset.sim
from infoset.kernels import VARIABLE, CompileNotice

_REDUCTIONS = ("max", "min", "sum", "any", "all", "argmax", "argmin", "take", "copy")
"""Methods of arrays that allocate memory in Numba."""


@pytest.fixture(autouse=True)
def notices_are_shown(caplog: pytest.LogCaptureFixture) -> None:
    """Show the notices, also after a command with --quiet in the same process."""
    caplog.set_level(logging.WARNING, "infoset.kernels")


def kernel_of(module: str) -> Any:
    """Return the event of a kernel of a module, as Numba gives it."""

    def kernel() -> None:
        pass

    kernel.__module__ = module
    return SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=kernel)})


def compile_within(notice: CompileNotice, *modules: str) -> None:
    """Compile a kernel that calls one of the next module, and so on."""
    for module in modules:
        notice.on_start(kernel_of(module))
    for module in reversed(modules):
        notice.on_end(kernel_of(module))


def test_kernels_of_several_modules_give_one_notice_and_one_summary(
    caplog: pytest.LogCaptureFixture,
) -> None:
    notice = CompileNotice()
    with notice.of("infoset engage"):
        compile_within(notice, "infoset.engine.chains", "infoset.geometry.polygon")
        compile_within(notice, "infoset.sim.kepler")
        compile_within(notice, "numba.core")  # not ours

    first, last = caplog.messages

    assert first.startswith("compiling the numerical kernels of infoset engage (up to a minute), ")
    assert last.startswith("compiled 3 kernels of infoset engage in ")
    assert last.endswith(" s (infoset.engine, infoset.geometry, infoset.sim)")


def test_notice_has_the_purpose_of_each_command(caplog: pytest.LogCaptureFixture) -> None:
    notice = CompileNotice()
    for name in ("infoset engage", "infoset bound"):
        with notice.of(name):
            compile_within(notice, "infoset.sim.kepler")
    assert [line.count("infoset engage") for line in caplog.messages] == [1, 1, 0, 0]
    assert [line.count("infoset bound") for line in caplog.messages] == [0, 0, 1, 1]


def test_time_of_nested_kernels_is_counted_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    times_s = iter([10.0, 15.0])  # of the outer kernel only
    monkeypatch.setattr("time.perf_counter", lambda: next(times_s))
    notice = CompileNotice()
    with notice.of("infoset pareto"):
        compile_within(notice, "infoset.sim.kepler", "infoset.sim.kepler")

    assert "compiled 2 kernels of infoset pareto in 5.0 s" in caplog.messages[-1]


def test_notice_is_absent_if_nothing_is_compiled_or_the_command_is_quiet(
    caplog: pytest.LogCaptureFixture,
) -> None:
    notice = CompileNotice()
    with notice.of("infoset engage"):
        pass
    caplog.set_level(logging.ERROR, "infoset.kernels")  # as of --quiet
    with notice.of("infoset engage"):
        compile_within(notice, "infoset.sim.kepler")

    assert caplog.messages == []


def test_first_command_gives_the_notice_and_the_second_does_not(tmp_path: Path) -> None:
    environment = {**os.environ, VARIABLE: str(tmp_path)}

    def said() -> list[str]:
        command = [sys.executable, "-m", "infoset", "pareto", "--json", "-"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return [line for line in done.stderr.splitlines() if "compil" in line]

    first, last = said()

    assert (
        "compiling the numerical kernels of infoset pareto (up to a minute), once; later runs load "
    ) in first
    assert str(tmp_path) in first
    assert " of infoset pareto in " in last
    assert "(infoset.rendezvous)" in last
    assert said() == []


def test_kernels_that_allocate_nothing_call_no_reduction_of_an_array() -> None:
    """Numba compiles `max` of an array with memory that these kernels do not have.

    It fails only if no other kernel of the process was compiled with the same method before.
    """
    packages = (infoset, infoset.rendezvous, infoset.sim, infoset.guidance)
    folders = [Path(folder) for package in packages for folder in package.__path__]
    offenders = []
    kernels = 0
    for path in sorted({path for folder in folders for path in folder.rglob("*.py")}):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            decorators = [ast.unparse(decorator) for decorator in function.decorator_list]
            if not any(name.endswith("allocation_free") for name in decorators):
                continue
            kernels += 1
            offenders += [
                f"{path.name}: {function.name}: {ast.unparse(call)}"
                for call in ast.walk(function)
                if isinstance(call, ast.Call)
                and isinstance(call.func, ast.Attribute)
                and call.func.attr in _REDUCTIONS
            ]
    assert offenders == []
    # There are 110 in 2026: none would be found under another name of the decorator.
    assert kernels > 50
