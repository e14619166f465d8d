"""The page of an observer in a browser."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from infoset.experiments.observer.command import Errors, Observe
from infoset.experiments.observer.page import observer_page
from infoset.experiments.observer.report import ObserverReport
from infoset.experiments.observer.run import COMMAND
from tests.browser.conftest import Opened

Open = Callable[..., Opened]
HOSTILE = "<img src=x onerror=alert(1)>"


def observed(name: str, *settings: str) -> ObserverReport:
    return COMMAND.report(
        Observe(problem=name, settings=[*settings], errors=Errors.UNIFORM, smooth=True)
    )


@pytest.mark.parametrize("name", ["vehicle", "observer-2005"])
def test_keys_and_slider_step_through_the_sets(
    open_page: Open, screenshots: Path, name: str
) -> None:
    report = observed(name)
    last = len(report.estimates) - 1
    for width, scheme in ((1300, "light"), (390, "dark")):
        opened = open_page(observer_page(report), width, scheme)
        page = opened.page
        page.keyboard.press("ArrowRight")
        assert opened.shown_at() == "step 1"
        page.keyboard.press("End")
        assert opened.shown_at() == f"step {last}"
        page.get_by_role("slider", name="Time").fill("5")
        cells = page.locator("table").first.locator("th, td").all_inner_texts()
        numbers = dict(zip(cells[::2], cells[1::2], strict=True))
        first = report.problem.names[0]
        lower, upper = (text.replace("\u2212", "-") for text in numbers[first].split(" to "))
        assert float(lower) == pytest.approx(report.estimates[5].lower[0], rel=1e-5)
        assert float(upper) == pytest.approx(report.estimates[5].upper[0], rel=1e-5)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.screenshot(path=screenshots / f"observer-{name}-{width}-{scheme}.png", full_page=True)


def test_names_of_a_file_are_shown_as_text(open_page: Open) -> None:
    report = observed("vehicle", f'system.states=["{HOSTILE}", "speed"]')
    opened = open_page(observer_page(report))
    assert opened.page.locator("img").count() == 0
    assert HOSTILE in opened.page.locator("table").first.inner_text()
