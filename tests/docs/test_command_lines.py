"""Every command line in the prose runs, or has a reason above it why it does not."""

from __future__ import annotations

import contextlib
import io
import itertools
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from infoset.experiments.cli import commands, main

pytestmark = pytest.mark.docs

if TYPE_CHECKING:
    from tests.docs.conftest import Page

ROOT = Path(__file__).resolve().parents[2]

_STEPS = "--set step_s={0} --set camera.period_s={0}"
REDUCED = (
    (r"^infoset experiment\b(?!.* --runs)", "infoset experiment --runs 2"),
    (r"--runs (\d+|needed)", "--runs 2"),
    (r"--single-runs \d+", "--single-runs 2"),
    (r"--engagements (\d+|N)", "--engagements 8"),
    (r"--budget \d+", "--budget 20"),
    # An axis of a sweep or a map is reduced to its ends.
    (r"(=(?:log:)?[\d.e+-]+:[\d.e+-]+):\d+", r"\1:2"),
    # The grid of a map has 2121 points.
    (
        r"^infoset pursuit-map (\S+)(?!.* --x)",
        r"infoset pursuit-map \1 --x phase_deg=-20:20:3 --y thrust_ratio=0.2:0.5:2",
    ),
    # The flights of the missions have thousands of steps.
    (r"^infoset experiment (dart-2022|haiv-2013)\b", rf"infoset experiment \1 {_STEPS.format(30)}"),
    (
        r"^infoset experiment deep-impact-2005\b",
        f"infoset experiment deep-impact-2005 {_STEPS.format(150)}",
    ),
    # A narrow interval needs too many runs for a test.
    (r" --until \"[^\"]*\"", ""),
)
"""Substitutions that reduce a line before it is run, in this order. Its effect stays the same."""

SLOW = (
    r"^infoset (sweep|campaign|report|compare|bound|adversary|pursuit-map)\b",
    r"^infoset (pursuit leo-pursuit|multipoint asteroid-tour)\b",
    r"^infoset multipoint .*--(order|times) best\b",
    r"^infoset reach\b",
    r"^infoset replay .*--gif\b",
    # Figures take seconds; quick lines draw those of `experiment` and `replay`.
    r"^infoset (pareto|multipoint|pursuit)\b.* --out\b",
    r"^infoset engage (?!.* --record\b).* --out\b",
    r"^python ",
)
"""Lines that run with -m thorough only."""

ELSEWHERE = {
    "python benchmarks/page_speed.py": (
        "it takes minutes in a browser; tests/browser opens the same pages"
    ),
}
"""Lines in running text (without a comment above them) that are not run, and the reason."""

SET_UP = (
    r"(python3 -m venv \.venv|\. \.venv/bin/activate|\.venv/bin/python -m pytest"
    r"|\.venv/bin/pip install -c constraints\.txt (\S+|-e \S+))"
)
"""Lines that create an environment and run these tests. `.ci/run` runs them; these tests check the
names in them.
"""

_PROMPT = "$ "
_PLACEHOLDER = re.compile(
    r"\[|\||\.\.\.|=?\b[A-Z]+\b(?!\w)|^infoset [a-z-]+( [a-z-]+| --[a-z-]+)?$"
)
"""A placeholder, or the name of a command without arguments."""


def lines_of(text: str) -> Iterator[str]:
    """Yield the command lines of a block, continued ones joined, without comments."""
    lines = text.replace("\\\n", " ").splitlines()
    if any(line.startswith(_PROMPT) for line in lines):  # a session: the other lines are output
        lines = [line.removeprefix(_PROMPT) for line in lines if line.startswith(_PROMPT)]
    for line in lines:
        for part in line.split(" && "):
            bare = re.split(r"(?:^|\s)#", part)[0]
            if bare.strip():
                yield re.sub(r"\s+", " ", bare).strip()


def inline_lines(page: Page) -> list[str]:
    """Return the command lines in the running text."""
    return re.findall(
        r"`((?:infoset|python (?:benchmarks|docs)/[^\s`]+)(?: [^`\n]+)?)`",
        re.sub(r"\s*\n\s*", " ", page.prose()),
    )


def is_complete(line: str) -> bool:
    """Whether a line in the running text is complete: it contains no placeholder."""
    return " " in line and _PLACEHOLDER.search(re.sub(r"^python \S+", "", line)) is None


def reduced(line: str) -> str:
    """Return the line, reduced by the rules above."""
    for pattern, small in REDUCED:
        line = re.sub(pattern, small, line)
    return line


def is_slow(line: str) -> bool:
    """Whether a line takes more than a few seconds, even if it is reduced."""
    return any(re.search(pattern, line) for pattern in SLOW)


def run(line: str, folder: Path) -> None:
    """Run a line in a folder, in this process if possible; figures are drawn, but not written."""
    words = shlex.split(reduced(line.replace(".venv/bin/", "")))
    assert words, line
    if words[0] == "python":
        assert (ROOT / words[1]).is_file(), line
        done = subprocess.run(
            [sys.executable, ROOT / words[1], *words[2:]],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        return
    assert words[0] == "infoset", (
        f"{line}: no rule to run it; put a comment <!-- not run: REASON --> above it"
    )
    into = None
    if ">" in words:
        words, into = words[: words.index(">")], folder / words[words.index(">") + 1]
    if "--out" in words and (folder / words[words.index("--out") + 1]).exists():
        words.append("--overwrite")  # another line of the page wrote there
    printed = io.StringIO()
    complained = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "infoset.experiments.common.figure_style.figure_bytes",
            lambda _: [("pdf", b""), ("png", b"")],
        )
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(complained),
            pytest.raises(SystemExit) as left,
        ):
            main(words[1:])
    assert not left.value.code, f"{line}\n{printed.getvalue()}\n{complained.getvalue()}"
    if into is not None:
        into.write_text(printed.getvalue(), encoding="utf-8")


def fenced_lines(page: Page) -> list[str]:
    """Return the command lines of the blocks of a page that are run, without set-up."""
    lines = [
        line
        for block in page.blocks("sh", "console")
        if not block.not_run
        for line in lines_of(block.text)
    ]
    return [line for line in lines if not re.fullmatch(SET_UP, line.replace('"', ""))]


def lines_to_run(page: Page) -> list[str]:
    """Return all command lines of a page in their order, each once."""
    lines = dict.fromkeys([*fenced_lines(page), *filter(is_complete, inline_lines(page))])
    return [line for line in lines if line not in ELSEWHERE]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def quick_lines(page: Page) -> list[str]:
    """Return the lines of a page that take a few seconds at most."""
    return [line for line in lines_to_run(page) if not is_slow(line)]


def test_the_quick_lines_run(page: Page, pages: list[Page], folder: Path) -> None:
    lines = quick_lines(page)
    for other in pages[: [each.name for each in pages].index(page.name)]:
        there = quick_lines(other)
        shared = [line for line in lines if line in there]
        same = itertools.takewhile(
            lambda pair: pair[0] == pair[1], zip(shared, there, strict=False)
        )
        tested = [line for line, _ in same]  # the other page begins with them
        lines = [line for line in lines if line not in tested]
    for line in lines:
        run(line, folder)


@pytest.mark.thorough
def test_all_lines_run_in_their_order(page: Page, folder: Path) -> None:
    lines = lines_to_run(page)
    if any(map(is_slow, lines)):
        for line in lines:
            run(line, folder)


def test_blocks_that_are_not_run_have_a_reason(pages: list[Page]) -> None:
    left_out = {block.text: block for page in pages for block in page.blocks() if block.not_run}
    assert all(len(block.not_run.split()) >= 4 for block in left_out.values())
    # A further block that is not run must be listed here.
    names = ["CONTRIBUTING.md", "benchmarks/README.md", *["docs/campaigns.md"] * 5]
    names += [*["docs/guaranteed-rendezvous.md"] * 2, "docs/wrong-images.md"]
    assert sorted(block.page for block in left_out.values()) == names


def check_options(line: str) -> None:
    """Check that the command of a line, and every option in it, exist."""
    words = re.sub(r"[\[\]|,]", " ", line).split()[1:]
    command: Any = commands()
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words[0]]
        words = words[1:]
    named = (
        not words
        or words[0].startswith("--")
        or words[0].isupper()
        or not hasattr(command, "commands")
    )
    assert named, f"{line}: no such command"
    known = {
        name
        for parameter in command.params
        for name in (*parameter.opts, *parameter.secondary_opts)
    }
    assert {word for word in words if word.startswith("-")} <= {*known, "--help", "-"}, line


def test_lines_with_placeholders_name_commands_and_options_that_exist(page: Page) -> None:
    for line in inline_lines(page):
        if line.startswith("infoset"):
            check_options(line)
        else:
            assert (ROOT / line.split()[1]).is_file(), line


def test_examples_in_the_help_name_options_that_exist() -> None:
    root: Any = commands()
    examples = [
        command.epilog.removeprefix("Example: ")
        for command in root.commands.values()
        if command.epilog
    ]
    assert len(examples) >= 14
    for example in examples:
        check_options(example)
