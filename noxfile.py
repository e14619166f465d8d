"""Checks in other environments: the distributed files, other versions of Python, old libraries.

`nox -l` lists the sessions. All except `audit` build the wheel, install it and run the tests in an
empty folder, so that nothing can depend on the checkout. Arguments after `--` go to pytest.
"""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import nox

ROOT = Path(__file__).parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
TOOLS = ("mypy", "ruff", "import-linter", "pytest-cov")
"""Packages of the extra `test` that check the source code; the tests do not import them."""
TOO_NEW = ("heyoka",)
"""Packages of the extra `test` whose oldest wheels need numpy 2."""

KERNELS = ("Prescott", "Haswell", "SkylakeX")
"""Kernels of OpenBLAS that differ in the order of their operations: SSE3, AVX2 with FMA,
AVX-512.
"""
PROCESSORS = ("generic", "x86-64-v3", "")
"""Processors for which Numba compiles: without and with FMA, and the machine's own."""
BUSY_LOOPS = 4
"""Processes that only compute, beside the tests: as slow as a shared machine."""

nox.options.sessions = ["wheel"]
nox.options.error_on_missing_interpreters = False


@nox.session(python="3.11")
def wheel(session: nox.Session) -> None:
    """Build wheel and sdist, check them, and run every test against the installed wheel in an empty
    folder.
    """
    distributions = built(session)
    session.run("twine", "check", "--strict", *map(str, distributions))
    session.install("-c", str(ROOT / "constraints.txt"), f"{distributions[0]}[test]")
    run_tests(session)


@nox.session(python="3.11")
def thorough(session: nox.Session) -> None:
    """Run the tests marked thorough, which take about half an hour, against the installed wheel."""
    session.install("-c", str(ROOT / "constraints.txt"), f"{built(session)[0]}[test]")
    run_tests(session, "-m", "thorough")


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Run every test with another version of Python."""
    session.install("-c", str(ROOT / "constraints.txt"), f"{built(session)[0]}[test]")
    run_tests(session)


@nox.session(python="3.11")
def oldest(session: nox.Session) -> None:
    """Run every test with the oldest libraries that pyproject.toml allows."""
    extra = PROJECT["optional-dependencies"]["test"]
    needed = [package for package in extra if not re.match("|".join((*TOOLS, *TOO_NEW)), package)]
    session.install("--only-binary", ":all:", *map(exactly, [*PROJECT["dependencies"], *needed]))
    session.install("--no-deps", str(built(session)[0]))
    # Old libraries emit deprecation warnings; they are not errors here.
    run_tests(session, "-W", "default")


@nox.session(python="3.11")
def portable(session: nox.Session) -> None:
    """Run every test with each order of floating-point operations, hash seed and order of tests, on
    a busy machine.

    The machine must have AVX-512 for the kernel SkylakeX. Each of the nine combinations compiles
    all kernels, and takes three times as long as the tests alone.
    """
    session.install(
        "-c", str(ROOT / "constraints.txt"), f"{built(session)[0]}[test]", "pytest-randomly"
    )
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BUSY_LOOPS)]
    try:
        for kernel, processor in itertools.product(KERNELS, PROCESSORS):
            session.log(
                f"OPENBLAS_CORETYPE={kernel} NUMBA_CPU_NAME={processor or '(this machine)'}"
            )
            session.env["OPENBLAS_CORETYPE"] = kernel
            session.env["NUMBA_CPU_NAME"] = processor or None
            session.env["PYTHONHASHSEED"] = "random"
            with tempfile.TemporaryDirectory() as cache:
                session.env["NUMBA_CACHE_DIR"] = cache
                run_tests(session)
    finally:
        for process in busy:
            process.kill()


@nox.session
def audit(session: nox.Session) -> None:
    """Check the versions in constraints.txt for known vulnerabilities."""
    session.install("pip-audit")
    session.run(
        "pip-audit",
        "--strict",
        "--no-deps",
        "--disable-pip",
        "--requirement",
        str(ROOT / "constraints.txt"),
    )


def built(session: nox.Session) -> tuple[Path, Path]:
    """Build the distributions and return the paths of the wheel and the sdist."""
    session.install("build", "twine")
    folder = Path(session.create_tmp()) / "dist"
    shutil.rmtree(folder, ignore_errors=True)
    session.run("python", "-m", "build", "--outdir", str(folder), str(ROOT))
    return next(folder.glob("*.whl")).absolute(), next(folder.glob("*.tar.gz")).absolute()


def run_tests(session: nox.Session, *options: str) -> None:
    """Run the tests in an empty folder, with the settings of the project's pytest."""
    folder = Path(session.create_tmp()) / "empty"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "tests", folder / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    session.chdir(folder)
    session.run("infoset", "--version")
    session.run("python", "-m", "pytest", *options, *session.posargs)


def exactly(requirement: str) -> str:
    """Return a requirement that allows only its lower bound."""
    return requirement.replace(">=", "==", 1)
