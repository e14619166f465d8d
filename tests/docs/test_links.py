"""Links between pages lead to existing files and anchors; nothing is loaded from the network."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.docs.conftest import Page

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
# All external addresses; they are not opened.
OUTSIDE = {"https://keepachangelog.com/en/1.1.0/", "https://semver.org/spec/v2.0.0.html"}

_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_TOCTREE_ENTRY = re.compile(r"^(?:.*<)?([\w/.-]+)>?$")


@cache
def anchors(path: Path) -> set[str]:
    """Return the anchors of the headings of a page, as both the site and hosts of repositories make
    them.
    """
    text = re.sub(
        r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    titles = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return {re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", title.strip().lower())) for title in titles}


def source_of(target: Path) -> Path | None:
    """Return the file that a link leads to; for a page of the gallery, its example."""
    if target.exists() and "gallery" not in target.parts:
        return target
    if target.parent == DOCS / "gallery":
        made_from = (
            DOCS
            / "examples"
            / ("GALLERY_HEADER.rst" if target.stem == "index" else f"{target.stem}.py")
        )
        return made_from if made_from.exists() else None
    return None


def test_targets_of_links_exist(page: Page) -> None:
    for link in _LINK.findall(page.prose()):
        if "://" in link:
            assert link in OUTSIDE, f"{page.name}: {link} is not among the addresses known here"
            continue
        file, _, anchor = link.partition("#")
        target = (page.path.parent / file).resolve() if file else page.path
        source = source_of(target)
        assert source is not None, f"{page.name}: {link} leads nowhere"
        if anchor:
            assert anchor in anchors(source), f"{page.name}: {link}: no such heading"


def test_every_page_of_the_site_is_in_a_table_of_contents(pages: list[Page]) -> None:
    site = [page for page in pages if page.name.startswith("docs/")]
    listed = {
        (page.path.parent / entry[1]).resolve()
        for page in site
        for block in page.blocks("{toctree}")
        for line in block.text.splitlines()
        if (entry := _TOCTREE_ENTRY.match(line)) is not None
    }
    assert {page.path.with_suffix("") for page in site} - listed == {DOCS / "index"}


def test_pictures_are_small_and_made_by_commands() -> None:
    pictures = [path for path in DOCS.iterdir() if path.suffix in {".png", ".gif"}]
    assert pictures
    assert (DOCS / "flight.gif").stat().st_size < 300_000
    assert all(path.stat().st_size < 400_000 for path in pictures)
