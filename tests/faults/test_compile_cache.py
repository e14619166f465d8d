"""Compiled kernels: no home, an installation that may not be written, two processes at once."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

import infoset
from experiments.common import compile_cache
from experiments.common.compile_cache import VARIABLE, keep_kernels_somewhere
from infoset import _compile
from rendezvous import _compile as _compile_of_rendezvous
from tests.faults.conftest import begin, ended

PACKAGES = ("infoset", "guidance", "sim", "rendezvous", "experiments")


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A machine where neither the installation nor the home can be written; returns the folder for temporary files."""
    monkeypatch.setenv(VARIABLE, "put back afterwards as it was, even if it was not there")
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setattr(compile_cache, "_written_beside_sources", lambda: False)
    monkeypatch.setenv("HOME", "/dev/null/nobody")
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/nobody")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_a_folder_of_ones_own_is_found(nowhere: Path) -> None:
    keep_kernels_somewhere()
    folder = Path(os.environ[VARIABLE])
    assert folder.parent == nowhere
    assert folder.stat().st_mode & 0o777 == 0o700
    del os.environ[VARIABLE]
    keep_kernels_somewhere()
    assert Path(os.environ[VARIABLE]) == folder  # the same one next time


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="users and modes of POSIX")
def test_a_folder_that_others_may_write_is_not_believed(nowhere: Path) -> None:
    """Compiled kernels are programs: whoever may put one there runs what he likes as this user."""
    folder = nowhere / f"infoset-kernels-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    keep_kernels_somewhere()
    assert VARIABLE not in os.environ
    folder.rmdir()
    elsewhere = nowhere / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    folder.symlink_to(elsewhere)
    keep_kernels_somewhere()
    assert VARIABLE not in os.environ


def test_what_a_person_has_chosen_stays(nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "/mine")
    keep_kernels_somewhere()
    assert os.environ[VARIABLE] == "/mine"
    assert list(nowhere.iterdir()) == []


@pytest.mark.usefixtures("nowhere")
def test_no_folder_at_all_is_left_to_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", "/dev/null/tmp")
    keep_kernels_somewhere()
    assert VARIABLE not in os.environ


@pytest.mark.parametrize("compiled", [_compile.compiled, _compile_of_rendezvous.compiled])
def test_a_kernel_that_can_be_kept_nowhere_is_compiled_all_the_same(compiled: object) -> None:
    scope: dict[str, object] = {}
    source = "def twice(x):\n    return 2.0 * x\n"
    exec(compile(source, "<nowhere>", "exec"), scope)  # Numba finds no file to keep anything beside
    with pytest.warns(RuntimeWarning, match="NUMBA_CACHE_DIR"):
        twice = compiled(scope["twice"])  # type: ignore[operator]
    assert twice(1.5) == 3.0


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages, copied without anything compiled, where nobody may write."""
    folder = tmp_path_factory.mktemp("installed")
    here = Path(infoset.__file__).parents[1]
    for name in PACKAGES:
        shutil.copytree(here / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for each in (folder, *folder.rglob("*")):
        each.chmod(0o500 if each.is_dir() else 0o400)
    return folder


def environment_of(installation: Path, temporary: Path, home: Path) -> dict[str, str]:
    """Of somebody who has chosen nothing."""
    return {
        VARIABLE: "",
        "PYTHONPATH": str(installation),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / ".cache"),
        "TMPDIR": str(temporary),
        "MPLCONFIGDIR": str(temporary),
    }


@pytest.mark.slow
def test_a_read_only_installation_and_no_home(installation: Path, tmp_path: Path, ordinary: tuple[str, ...]) -> None:
    sealed, temporary = tmp_path / "home", tmp_path / "tmp"
    sealed.mkdir(mode=0o500)
    temporary.mkdir()
    environment = environment_of(installation, temporary, sealed)
    first, second = (
        ended(begin("pareto", folder=tmp_path, environment=environment, prefix=ordinary)) for _ in range(2)
    )
    kept = temporary / f"infoset-kernels-{os.getuid()}"
    assert (first.code, second.code) == (0, 0)
    assert [line for line in first.err.splitlines() if "compiling" in line] == [
        f"compiling the kernels, once (about five seconds); they are kept in {kept}, not beside their source ..."
    ]
    assert second.err == ""
    assert first.out == second.out
    assert list(kept.rglob("*.nbc"))


@pytest.mark.slow
def test_a_read_only_installation_and_a_home(installation: Path, tmp_path: Path, ordinary: tuple[str, ...]) -> None:
    (tmp_path / "home").mkdir()
    environment = environment_of(installation, tmp_path, tmp_path / "home")
    left = ended(begin("pareto", folder=tmp_path, environment=environment, prefix=ordinary))
    assert left.code == 0
    assert f"they are kept in {tmp_path / 'home'}" in left.err
    assert list((tmp_path / "home").rglob("*.nbc"))


@pytest.mark.slow
def test_nowhere_to_keep_anything(installation: Path, tmp_path: Path, ordinary: tuple[str, ...]) -> None:
    """The library alone, as in a notebook: it warns, and works."""
    code = "from rendezvous.relative_motion import _circular; print(_circular.angle_less_sine(1.0))"
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
    assert done.stderr.count("RuntimeWarning: ") == 1
    assert "NUMBA_CACHE_DIR" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", [("pareto", "--json", "-"), ("multipoint", "--json", "-")])
def test_two_processes_compile_at_once_into_one_cache(command: tuple[str, ...], tmp_path: Path) -> None:
    environment: Mapping[str, str] = {VARIABLE: str(tmp_path / "kernels")}
    both = [begin(*command, folder=tmp_path, environment=environment) for _ in range(2)]
    one, other = (ended(each) for each in both)
    after = ended(begin(*command, folder=tmp_path, environment=environment))
    for left in (one, other, after):
        assert left.code == 0
        assert "Traceback" not in left.err
    assert without_times(one.out) == without_times(other.out) == without_times(after.out)
    assert "compiling" not in after.err


def without_times(text: str) -> list[str]:
    return [line for line in text.splitlines() if "elapsed" not in line and "_took_" not in line]
