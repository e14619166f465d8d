"""The built site: links, pictures, and that it loads nothing from the network. CONTRIBUTING.md has
the build command.

INFOSET_SITE is the folder of the site. If it is set and the site does not exist, the tests fail.
"""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import ClassVar
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    *(
        "infoset",
        "infoset.guidance",
        "infoset.sim",
        "infoset.rendezvous.relative_motion",
        "infoset.rendezvous.pareto",
        "infoset.rendezvous.multipoint",
    ),
    *(
        "infoset.rendezvous.reachability",
        "infoset.rendezvous.pursuit_evasion",
        "infoset.geometry.polytope",
    ),
)
LOADED = {"script": "src", "img": "src", "source": "src", "iframe": "src"}


@dataclass
class _Reader(HTMLParser):
    """Identifiers, loaded files, links and pictures of a page."""

    ids: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    loads: list[str] = field(default_factory=list)
    pictures: list[str | None] = field(default_factory=list)
    LOADING_LINKS: ClassVar[tuple[str, ...]] = (
        "stylesheet",
        "preload",
        "icon",
        "modulepreload",
        "shortcut icon",
    )

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if identity := given.get("id"):
            self.ids.add(identity)
        if tag == "a" and (link := given.get("href")):
            self.links.append(link)
        if tag == "link" and given.get("rel") in self.LOADING_LINKS:
            self.loads.append(given.get("href") or "")
        if tag in LOADED and (source := given.get(LOADED[tag])):
            self.loads.append(source)
        if tag == "img":
            self.pictures.append(given.get("alt"))


@pytest.fixture(scope="module")
def site() -> Path:
    """The folder of the built site."""
    named = os.environ.get("INFOSET_SITE")
    folder = Path(named) if named else ROOT / "docs" / "_build"
    if not (folder / "index.html").is_file():
        assert named is None, f"no site in {folder}"
        pytest.skip("the site is not built: python -m sphinx -W --keep-going docs docs/_build")
    return folder.resolve()


@pytest.fixture(scope="module")
def read(site: Path) -> dict[Path, _Reader]:
    """All pages of the site."""
    pages = {}
    for path in sorted(site.rglob("*.html")):
        if "_static" not in path.parts:
            pages[path] = _Reader()
            pages[path].feed(path.read_text(encoding="utf-8"))
    return pages


def public_names() -> Iterator[str]:
    """Yield every public name of the packages."""
    for package in PACKAGES:
        yield from (f"{package}.{name}" for name in importlib.import_module(package).__all__)


def test_targets_of_links_and_anchors_in_the_site_exist(
    site: Path, read: dict[Path, _Reader]
) -> None:
    seen = 0
    for page, reader in read.items():
        for link in reader.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            assert target.is_file(), f"{page.relative_to(site)}: {link}"
            if parts.fragment and target in read:
                ids = read[target].ids
                assert unquote(parts.fragment) in ids, (
                    f"{page.relative_to(site)}: {link}: no such anchor"
                )
            seen += 1
    assert seen > 1000


def test_nothing_is_loaded_from_elsewhere(site: Path, read: dict[Path, _Reader]) -> None:
    for page, reader in read.items():
        for source in reader.loads:
            if source.startswith("data:"):
                continue
            parts = urlsplit(source)
            assert not parts.scheme, f"{page.relative_to(site)} loads {source}"
            assert not parts.netloc, f"{page.relative_to(site)} loads {source}"
            assert (page.parent / unquote(parts.path)).is_file(), (
                f"{page.relative_to(site)}: no {source}"
            )
    for sheet in site.rglob("*.css"):
        assert (
            re.search(
                r"url\(\s*['\"]?(https?:)?//|@import\s+['\"]?https?:", sheet.read_text("utf-8")
            )
            is None
        ), sheet


def test_pictures_have_an_alternative_text(site: Path, read: dict[Path, _Reader]) -> None:
    for page, reader in read.items():
        # Thumbnails of the gallery have no text; their titles have the same content.
        titled = page == site / "gallery" / "index.html"
        assert all(text or (text is not None and titled) for text in reader.pictures), (
            page.relative_to(site)
        )


def test_every_public_name_is_described(read: dict[Path, _Reader]) -> None:
    described = set().union(*(reader.ids for reader in read.values()))
    assert sorted(set(public_names()) - described) == []


def test_examples_were_run_and_their_figures_are_there(site: Path) -> None:
    images = {path.name for path in (site / "_images").iterdir()}
    for example in (ROOT / "docs" / "examples").glob("plot_*.py"):
        assert f"sphx_glr_{example.stem}_001.png" in images
