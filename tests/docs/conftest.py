"""Pages of the documentation, their blocks, and which blocks are run."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
_BLOCK = re.compile(
    r"(?:^<!-- (?P<comment>[^\n]*?) -->\n)?"
    r"^(?P<fence>```+|~~~+)(?P<language>[^\n`]*)\n"
    r"(?P<text>.*?)^(?P=fence)[ ]*$",
    flags=re.DOTALL | re.MULTILINE,
)
_NOT_RUN = "not run: "


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Parameters
    ----------
    page : str
        Path of the page in the project.
    not_run : str
        Reason from the comment `<!-- not run: REASON -->` above the block; empty if tests run it.
    """

    page: str
    language: str
    text: str
    not_run: str


@dataclass(frozen=True)
class Page:
    """A page of prose.

    Parameters
    ----------
    name : str
        Path in the project.
    """

    name: str
    text: str

    @property
    def path(self) -> Path:
        """Absolute path."""
        return ROOT / self.name

    def blocks(self, *languages: str) -> list[Block]:
        """Return the fenced blocks in some languages, or in all."""
        blocks = []
        for match in _BLOCK.finditer(self.text):
            language = match["language"].strip()
            comment = match["comment"] or ""
            if not languages or language in languages:
                reason = comment.removeprefix(_NOT_RUN) if comment.startswith(_NOT_RUN) else ""
                blocks.append(Block(self.name, language, match["text"], reason))
        return blocks

    def prose(self) -> str:
        """Return the text without fenced blocks and comments."""
        return re.sub(r"<!--.*?-->", "", _BLOCK.sub("", self.text), flags=re.DOTALL)


def all_pages() -> list[Page]:
    """Return every page of prose in the project, the pages of the site first."""
    site = [
        path
        for path in sorted((ROOT / "docs").rglob("*.md"))
        if not {"_build", "gallery"} & set(path.parts)
    ]
    names = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md", "benchmarks/README.md")
    others = [ROOT / name for name in names]
    return [
        Page(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
        for path in (*site, *others)
    ]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrise the tests with an argument `page` with all pages."""
    if "page" in metafunc.fixturenames:
        pages = all_pages()
        metafunc.parametrize("page", pages, ids=[page.name for page in pages])


@pytest.fixture(scope="session")
def pages() -> list[Page]:
    """All pages of prose."""
    return all_pages()
