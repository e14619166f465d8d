"""Measure pages: time to write, size, time until the first drawing, and frames per second.

    python benchmarks/page_speed.py

It needs Chromium and the extra `browser`, and prints a table in Markdown. docs/replay.md contains
such a table.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

REPEATS = 3
PLAYED_S = 3.0
PAGES = {
    "replay, random noise": ["replay", "a-random.npz"],
    "replay, game noise": ["replay", "a-game.npz"],
    "replay, both side by side": ["replay", "a-random.npz", "a-game.npz"],
    "pareto-2008": ["pareto", "pareto-2008"],
    "service-3": ["multipoint", "service-3"],
    "rendezvous-2021": ["reach", "rendezvous-2021"],
    "geo-pursuit": ["pursuit", "geo-pursuit"],
}


def main() -> None:
    """Measure every page and print the table."""
    from playwright.sync_api import sync_playwright

    program = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome")))
    )
    with TemporaryDirectory() as name, sync_playwright() as driver:
        folder = Path(name)
        infoset(
            folder, "engage", "asteroid-1997", "--noise", "both", "--record", "a.npz", "--quiet"
        )
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        print(f"{browser.browser_type.name} {browser.version}")
        print(
            "| page | command, s | processor, s | size, MB | first draw, s | frames/s, 1300 px | "
            "390 px |"
        )
        print("|---|---|---|---|---|---|---|")
        for title, command in PAGES.items():
            took_s, busy_s = np.min([timed(folder, command) for _ in range(REPEATS)], axis=0)
            file = folder / "page.html"
            wide = [drawn(browser, file, 1300) for _ in range(REPEATS)]
            narrow = [drawn(browser, file, 390) for _ in range(REPEATS)]
            first_s = min(first for first, _ in wide)
            frames = [max(rate for _, rate in measured) for measured in (wide, narrow)]
            size = file.stat().st_size / 1e6
            cells = f"{took_s:.2f} | {busy_s:.2f} | {size:.2f}"
            print(f"| {title} | {cells} | {first_s:.2f} | {frames[0]:.0f} | {frames[1]:.0f} |")
        browser.close()


def infoset(folder: Path, *arguments: str) -> None:
    """Run a command."""
    code = "from infoset.experiments.cli import main; main()"
    subprocess.run([sys.executable, "-c", code, *arguments], cwd=folder, check=True)


def timed(folder: Path, command: list[str]) -> tuple[float, float]:
    """Return the elapsed time and the processor time of a command that writes a page, with the
    start of Python, s.
    """
    began_s = perf_counter()
    before = getrusage(RUSAGE_CHILDREN)
    infoset(folder, *command, "--html", "page.html", "--overwrite", "--quiet")
    took_s = perf_counter() - began_s
    after = getrusage(RUSAGE_CHILDREN)
    return took_s, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def drawn(browser: Any, file: Path, width: int) -> tuple[float, float]:
    """Return the time until a page is first drawn, s, and its frames per second while it plays in a
    loop.
    """
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto(file.as_uri())
    while not page.evaluate("performance.getEntriesByName('first-draw').length"):
        page.wait_for_timeout(10)
    first_s = page.evaluate("performance.getEntriesByName('first-draw')[0].startTime") / 1e3
    # One frame per refresh of the screen; playing starts again after the end.
    page.evaluate(
        "player.speed = 60 / player.coarse; setInterval(() => player.playing || player.play(), 1)"
    )
    drawn_before, began_ms = page.evaluate("[player.drawn, performance.now()]")
    page.wait_for_timeout(1e3 * PLAYED_S)
    drawn_after, ended_ms = page.evaluate("[player.drawn, performance.now()]")
    page.close()
    return first_s, 1e3 * (drawn_after - drawn_before) / (ended_ms - began_ms)


if __name__ == "__main__":
    main()
