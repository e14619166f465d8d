"""Sessions that need other environments than the one at hand: what is distributed, other Pythons, old libraries.

`nox -l` lists them. All but `audit` install the wheel that is built here and run in an empty folder with the tests
alone: nothing may depend on the checkout. Arguments after `--` go to pytest.
"""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import nox

ROOT = Path(__file__).parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
TOOLS = ("mypy", "ruff", "import-linter", "pytest-cov")
"""Of the extra `test`: they look at the checkout, or at what the tests do in it."""
TOO_NEW = ("heyoka",)
"""Of the extra `test`: an oracle whose oldest wheels need numpy 2."""

nox.options.sessions = ["wheel"]
nox.options.error_on_missing_interpreters = False


@nox.session(python="3.11")
def wheel(session: nox.Session) -> None:
    """Build wheel and sdist, check them, and run every test against the installed wheel in an empty folder."""
    made = built(session)
    session.run("twine", "check", "--strict", *map(str, made))
    session.install("-c", str(ROOT / "constraints.txt"), f"{made[0]}[test]")
    run_tests(session)


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Run every test on another Python."""
    session.install("-c", str(ROOT / "constraints.txt"), f"{built(session)[0]}[test]")
    run_tests(session)


@nox.session(python="3.11")
def oldest(session: nox.Session) -> None:
    """Run every test with the oldest libraries that pyproject.toml allows."""
    extra = PROJECT["optional-dependencies"]["test"]
    needed = [each for each in extra if not re.match("|".join((*TOOLS, *TOO_NEW)), each)]
    session.install("--only-binary", ":all:", *map(exactly, [*PROJECT["dependencies"], *needed]))
    session.install("--no-deps", str(built(session)[0]))
    # What the old libraries say of newer Pythons is theirs.
    run_tests(session, "-W", "default")


@nox.session
def audit(session: nox.Session) -> None:
    """Ask whether a version in constraints.txt has a vulnerability that is known."""
    session.install("pip-audit")
    session.run("pip-audit", "--strict", "--no-deps", "--disable-pip", "--requirement", str(ROOT / "constraints.txt"))


def built(session: nox.Session) -> tuple[Path, Path]:
    """Build the distributions; the wheel and the sdist it was built from."""
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
    """Return a requirement as its own lower bound."""
    return requirement.replace(">=", "==", 1)
