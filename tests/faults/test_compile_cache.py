"""Compiled kernels: stale sources, no home, an installation that may not be written, two processes
at once.
"""

from __future__ import annotations

import importlib
import json
import logging
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import infoset
from infoset import _compile
from infoset.kernels import VARIABLE, cache_folder
from infoset.limits import shown
from infoset.rendezvous import _compile as _compile_of_rendezvous

pytestmark = pytest.mark.thorough

PACKAGES = (
    "infoset",
    "infoset.guidance",
    "infoset.sim",
    "infoset.rendezvous",
    "infoset.experiments",
)


def twice(value: float) -> float:
    return 2.0 * value


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine where the home cannot be written."""
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setenv("HOME", "/dev/null/nobody")
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/nobody")


@pytest.mark.usefixtures("nowhere")
def test_the_folder_of_the_environment_comes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cache_folder(shown) is None
    monkeypatch.setenv(VARIABLE, str(tmp_path / "mine"))
    folder = cache_folder(shown)
    assert folder is not None
    assert folder.parent == tmp_path / "mine"


@pytest.mark.usefixtures("nowhere")
@pytest.mark.parametrize("compiled", [_compile.compiled, _compile_of_rendezvous.compiled])
def test_kernel_is_compiled_if_it_cannot_be_stored(
    compiled: Callable[..., Callable[[float], float]],
) -> None:
    assert compiled(twice)(1.5) == 3.0
    scope: dict[str, Any] = {"__name__": "example"}
    exec(compile("def thrice(x):\n    return 3.0 * x\n", "<no file>", "exec"), scope)
    assert compiled(scope["thrice"])(1.5) == 4.5


PROGRAM = """
import importlib, json, pathlib, sys
for texts in json.load(sys.stdin):
    for name, text in texts.items():
        path = pathlib.Path(sys.argv[1], name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for name in [name for name in sys.modules if name.partition(".")[0] == "infoset"]:
        del sys.modules[name]  # as in a new process, except that Numba is loaded already
    others = [each for each in sys.meta_path if not each.__module__.startswith("infoset")]
    sys.meta_path[:] = others
    importlib.invalidate_caches()
    from infoset import caller
    print(caller.call(1.0), sum(caller.call.stats.cache_hits.values()))
"""


@pytest.mark.parametrize("sim", ["infoset/sim", "sim"], ids=["installation", "checkout"])
def test_kernel_is_compiled_again_if_what_it_uses_has_changed(tmp_path: Path, sim: str) -> None:
    """Functions that a kernel calls and constants of other modules, of `infoset` and of a package
    inside it.
    """
    source = Path(infoset.__file__).parent
    texts = {
        f"infoset/{name}": (source / name).read_text()
        for name in ("__init__.py", "_compile.py", "kernels.py")
    }
    texts |= {
        f"{sim}/__init__.py": "",
        f"{sim}/constant.py": "FACTOR = 2.0\n",
        "infoset/callee.py": (
            "from infoset._compile import inlined\n"
            "from infoset.sim.constant import FACTOR\n"
            "\n"
            "\n"
            "@inlined\n"
            "def times(x):\n"
            "    return FACTOR * x\n"
        ),
        "infoset/caller.py": "from infoset import callee\nfrom infoset._compile import entry\n\n\n"
        "@entry\ndef call(x):\n    return callee.times(x)\n",
    }
    changes: tuple[dict[str, str], ...] = (
        {},
        {f"{sim}/constant.py": "FACTOR = 4.0\n"},
        {"infoset/callee.py": texts["infoset/callee.py"].replace("FACTOR * x", "x - FACTOR")},
        {},
    )

    done = subprocess.run(
        [sys.executable, "-B", "-c", PROGRAM, str(tmp_path / "packages")],
        input=json.dumps([texts | changed for changed in changes]),
        cwd=tmp_path,
        env={
            **os.environ,
            "PYTHONPATH": str(tmp_path / "packages"),
            VARIABLE: str(tmp_path / "cache"),
        },
        capture_output=True,
        text=True,
        check=True,
    )

    assert done.stdout.splitlines() == [
        "2.0 0",
        "4.0 0",
        "-1.0 0",
        "2.0 1",
    ]  # at last the first one, stored


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages, copied without anything compiled, where nobody may write."""
    folder = tmp_path_factory.mktemp("installed")
    for name in PACKAGES:
        package = Path(str(importlib.import_module(name).__file__)).parent
        inside = folder.joinpath(*name.split("."))
        without = shutil.ignore_patterns("__pycache__")
        shutil.copytree(package, inside, ignore=without, dirs_exist_ok=True)
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o500 if path.is_dir() else 0o400)
    return folder


def environment_of(installation: Path, temporary: Path, home: Path) -> dict[str, str]:
    """Environment of somebody who has chosen no folder."""
    return {
        VARIABLE: "",
        "PYTHONPATH": str(installation),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / ".cache"),
        "TMPDIR": str(temporary),
        "MPLCONFIGDIR": str(temporary),
    }


def test_kernels_work_if_no_folder_can_be_written(
    installation: Path, tmp_path: Path, ordinary: tuple[str, ...]
) -> None:
    """The library alone, as in a notebook: it works, and one line says what to do."""
    code = (
        "from infoset.rendezvous.relative_motion.clohessy_wiltshire import angle_less_sine; "
        "print(angle_less_sine(1.0))"
    )
    sealed = tmp_path / "home"
    sealed.mkdir(mode=0o500)
    done = subprocess.run(
        [*ordinary, sys.executable, "-c", code],
        cwd=tmp_path,  # in a checkout Python would take the packages from there
        env={**os.environ, **environment_of(installation, tmp_path, sealed)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    assert abs(float(done.stdout) - 0.1585290151921035) < 1e-15  # 1 - sin 1
    assert done.stderr.count("compiling") == 1
    assert "set NUMBA_CACHE_DIR" in done.stderr


WORKERS = """
import logging, sys
from infoset.experiments import load_scenario
from infoset.kernels import LOGGER, NOTICE
from infoset.sim.parallel import Task, simulate_tasks, worker_processes

if __name__ == "__main__":
    LOGGER.setLevel(int(sys.argv[1]))
    with NOTICE.of("infoset campaign"):
        scenario = load_scenario("asteroid-1997")
        with worker_processes(2) as pool:
            tasks = [Task(scenario, [number], 0) for number in range(4)]
            print(len(list(simulate_tasks(tasks, pool))))
"""


@pytest.mark.parametrize(("level", "notices"), [(logging.WARNING, 1), (logging.ERROR, 0)])
def test_worker_processes_give_one_notice_or_none_if_the_command_is_quiet(
    level: int, notices: int, tmp_path: Path
) -> None:
    program = tmp_path / "program.py"
    program.write_text(WORKERS)
    root = str(Path(infoset.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, program, str(level)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": root, VARIABLE: str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["4"]
    assert done.stderr.count("compiling the numerical kernels of infoset campaign") == notices
    assert done.stderr.count("compiling") == notices
