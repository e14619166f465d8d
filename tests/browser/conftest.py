"""A real, headless Chromium for the pages, where there is one.

Needs a Chromium of the system and the extra `browser`. Screenshots go to the folder that
INFOSET_SCREENSHOTS names.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Record, fly_one

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
HERE = Path(__file__).parent
_NUMBER = re.compile(r"[−-]?\d+(?:\.\d+)?(?:e[−-]?\d+)?")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A headless Chromium; a test that needs it is skipped where there is none."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(
            f"needs a Chromium: none of {', '.join(NAMES)} is on the path (Debian: apt-get install "
            "chromium)"
        )
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="needs the extra browser: pip install '.[browser]'"
    )
    with playwright.sync_playwright() as driver:
        # Root, as whom containers run, has no sandbox; the pages are ours.
        found = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture(scope="session")
def screenshots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where screenshots go."""
    named = os.environ.get("INFOSET_SCREENSHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@dataclass
class Opened:
    """A page in the browser, and what it said and asked for."""

    page: Any
    console: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def shown_at(self) -> str:
        """The time beside the slider."""
        return str(self.page.locator(".player output").inner_text())

    def until(self, expression: str, seconds: float = 60.0) -> None:
        """Wait until an expression of the page is true; the driver's own waiting needs eval, which
        pages forbid.
        """
        end = monotonic() + seconds
        while not self.page.evaluate(expression):
            assert monotonic() < end, f"{expression} was not true within {seconds} s"
            self.page.wait_for_timeout(20)

    def tip(self) -> str:
        """What the pointer is told."""
        assert self.page.locator("#tip").is_visible()
        return str(self.page.locator("#tip").inner_text())

    def point_at(self, canvas: str, place: str) -> None:
        """Move the pointer to a place on a canvas; both are expressions of the page, the place in
        its pixels.
        """
        self.page.evaluate(f"{canvas}.canvas.scrollIntoView({{block: 'center'}})")
        box = self.page.evaluate(
            f"(() => {{ const b = {canvas}.canvas.getBoundingClientRect(); return [b.left, b.top]; "
            f"}})()"
        )
        x, y = self.page.evaluate(place)
        self.page.mouse.move(box[0] + x, box[1] + y)


def numbers(text: str) -> list[float]:
    """The numbers in a text of a page."""
    return [float(found.replace("−", "-")) for found in _NUMBER.findall(text)]


@pytest.fixture
def open_page(browser: Any, tmp_path: Path) -> Iterator[Callable[..., Opened]]:
    """Open a page's HTML as a file; afterwards, there must have been no message, no error and no
    request.
    """
    opened: list[Opened] = []
    contexts: list[Any] = []

    def opener(html: str, width: int = 1300, scheme: str = "light") -> Opened:
        file = tmp_path / f"page-{len(opened)}.html"
        file.write_text(html, encoding="utf-8")
        contexts.append(
            browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
        )
        each = Opened(contexts[-1].new_page())
        each.page.on("console", lambda message: each.console.append(message.text))
        each.page.on("pageerror", lambda error: each.console.append(str(error)))
        each.page.on("request", lambda request: each.requests.append(request.url))
        each.page.goto(file.as_uri())
        each.until("performance.getEntriesByName('first-draw').length > 0")
        opened.append(each)
        return each

    yield opener
    for each in opened:
        assert each.console == []
        assert [url for url in each.requests if not url.startswith("file:")] == []
        assert len(each.requests) == 1
    for context in contexts:
        context.close()


@pytest.fixture(scope="session")
def records() -> list[Record]:
    """The published engagement under random noise and under game noise."""
    scenario = load_scenario("asteroid-1997")
    return [fly_one(replace(scenario, noise=kind)) for kind in (NoiseKind.RANDOM, NoiseKind.GAME)]
