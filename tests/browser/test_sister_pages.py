"""The pages of pursuit, reachability, visits and encounters in a browser."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.experiments.multipoint import run as multipoint
from infoset.experiments.multipoint.command import Multipoint
from infoset.experiments.pareto import run as pareto
from infoset.experiments.pareto.command import Pareto
from infoset.experiments.pursuit import run as pursuit
from infoset.experiments.pursuit.command import Pursuit
from infoset.experiments.reachability import run as reachability
from infoset.experiments.reachability.command import Reach
from infoset.rendezvous.pareto import min_sum_of_costs
from infoset.rendezvous.pursuit_evasion import history, orbital_axes
from tests.browser.conftest import Opened, numbers

Open = Callable[..., Opened]
SIX_DIGITS = 5e-6
HOSTILE = "<img src=x onerror=alert(1)>"
CLOSING = "</script><script>alert(2)</script>"


OPTIONS: dict[str, tuple[Any, Any]] = {
    "pareto": (pareto.COMMAND, Pareto()),
    "multipoint": (multipoint.COMMAND, Multipoint(settings=["max_control_m_s2=0.02"])),
    "reach": (reachability.COMMAND, Reach(select="energy,l1,peak")),
    "pursuit": (pursuit.COMMAND, Pursuit(problem="leo-pursuit")),
}


@pytest.fixture(scope="module")
def reports() -> dict[str, Any]:
    """Reports of one problem of each kind."""
    return {name: command.report(options) for name, (command, options) in OPTIONS.items()}


@pytest.fixture(scope="module")
def pages(reports: dict[str, Any]) -> dict[str, str]:
    return {name: OPTIONS[name][0].to_html(report) for name, report in reports.items()}


def rows(opened: Opened, table: int) -> dict[str, str]:
    """A table of numbers: text by name."""
    cells = opened.page.locator("table").nth(table).locator("th, td").all_inner_texts()
    return dict(zip(*[iter(cells)] * 2, strict=True))


@pytest.mark.parametrize("name", OPTIONS)
def test_slider_and_keys_move_the_time_wide_and_narrow(
    open_page: Open, pages: dict[str, str], screenshots: Path, name: str
) -> None:
    for width, scheme in ((1300, "light"), (390, "dark")):
        opened = open_page(pages[name], width, scheme)
        page = opened.page
        assert page.evaluate("player.frame") == 0
        page.keyboard.press("ArrowRight")
        assert page.evaluate("player.frame") == 1
        page.keyboard.press("End")
        assert page.evaluate("player.frame === DATA.time_s.length - 1")
        end = opened.shown_at()
        page.get_by_role("slider", name="Time").fill("60")
        assert page.evaluate("player.frame") == 60
        assert opened.shown_at() != end
        page.keyboard.press(" ")
        opened.until("player.frame > 62")
        page.keyboard.press(" ")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.screenshot(path=screenshots / f"{name}-{width}-{scheme}.png", full_page=True)


@pytest.mark.parametrize("name", OPTIONS)
def test_html_in_names_is_text(open_page: Open, reports: dict[str, Any], name: str) -> None:
    report = reports[name]
    owner = "rendezvous" if name == "reach" else "problem"
    problem = replace(getattr(report, owner), description=CLOSING)
    object.__setattr__(problem, "name", f"{HOSTILE}{CLOSING}")  # a file may not have this name
    worse = replace(report, **{owner: problem})
    if name == "pareto":
        first, *others = report.solution.costs
        costs = (replace(first, craft=replace(first.craft, name=HOSTILE)), *others)
        worse = replace(worse, solution=replace(report.solution, costs=costs))
    if name == "multipoint":
        first, *others = problem.target
        targets = (replace(first, name=f"{HOSTILE}{CLOSING}"), *others)
        worse = replace(worse, problem=replace(problem, target=targets))
    html = OPTIONS[name][0].to_html(worse)
    assert HOSTILE not in html
    assert CLOSING not in html
    opened = open_page(html)
    assert f"{HOSTILE}{CLOSING}" in opened.page.locator("h1").inner_text()
    assert opened.page.evaluate("document.images.length") == 0


def test_live_numbers_of_a_meeting(
    open_page: Open, pages: dict[str, str], reports: dict[str, Any]
) -> None:
    opened = open_page(pages["pareto"])
    page = opened.page
    solution = reports["pareto"].solution

    def check() -> None:
        point = np.array(page.evaluate("point"))
        shown = rows(opened, 0)
        values = {name: numbers(text)[0] for name, text in shown.items()}
        assert values["group loss"] == pytest.approx(
            float(solution.group_loss(point)), rel=SIX_DIGITS
        )
        for cost, whole, excess in zip(
            solution.costs, solution.cost_squared(point), solution.excess(point), strict=True
        ):
            assert values[f"J² of {cost.craft.name}"] == pytest.approx(whole, rel=SIX_DIGITS)
            assert values[f"excess of {cost.craft.name}"] == pytest.approx(excess, rel=SIX_DIGITS)
        for index, each in enumerate(
            page.evaluate("panels[0].view.tracks.map(({ points }) => points)")
        ):
            plan = solution.plan(index, point)
            flown = plan.state(plan.times(121))[:, :3]
            np.testing.assert_allclose(each, flown, rtol=1e-9, atol=1e-9 * np.abs(flown).max())

    check()
    box = page.evaluate(
        "(() => { const b = panel.canvas.getBoundingClientRect(); return [b.left, b.top]; })()"
    )
    x, y = page.evaluate("[panel.across(point[0]), panel.up(point[1])]")
    page.mouse.move(box[0] + x, box[1] + y)
    page.mouse.down()
    for step in (10, 40, 70):
        page.mouse.move(box[0] + x + step, box[1] + y - 0.5 * step)
        check()
    page.mouse.up()
    assert page.evaluate("point[0]") > solution.point[0] + 5.0  # it was dragged
    inputs = page.locator("input[type=number]")
    inputs.nth(0).fill("12.5")
    inputs.nth(1).fill("-3.25")
    assert page.evaluate("point") == [12.5, -3.25]
    check()
    page.get_by_label("Go to").select_option("minimum sum of costs")
    assert page.evaluate("point") == pytest.approx(min_sum_of_costs(solution).tolist(), rel=1e-12)
    check()


def test_hover_in_a_pursuit_shows_its_numbers(
    open_page: Open, pages: dict[str, str], reports: dict[str, Any]
) -> None:
    opened = open_page(pages["pursuit"])
    opened.page.evaluate("player.show(120)")
    sampled = history(reports["pursuit"].solution, 301)
    apart = np.linalg.norm(sampled.pursuer.position_m - sampled.evader.position_m, axis=1)
    opened.point_at("panels[4].panel", "[panels[4].panel.across(panels[4].times[120]), 60]")
    time, distance_km = numbers(opened.tip())
    assert [time, distance_km * 1e3] == pytest.approx(
        [sampled.time_s[120], apart[120]], rel=SIX_DIGITS
    )
    axes = orbital_axes(sampled.evader.position_m, sampled.evader.velocity_m_s)[120]
    outward, along, normal = axes @ (sampled.pursuer.position_m - sampled.evader.position_m)[120]
    opened.point_at("panels[1].panel", "panels[1].place(DATA.views[1].tracks[0].points[120])")
    said = opened.tip()
    assert said.startswith("pursuer")
    time, *seen_km = numbers(said)
    assert time == pytest.approx(sampled.time_s[120], rel=SIX_DIGITS)
    assert np.array(seen_km) * 1e3 == pytest.approx([outward, along, normal], rel=SIX_DIGITS)


def test_visits_end_at_their_targets(
    open_page: Open, pages: dict[str, str], reports: dict[str, Any]
) -> None:
    opened = open_page(pages["multipoint"])
    path = reports["multipoint"].path
    for time_s, state in zip(path.nodes.arrive_s.tolist(), path.arrival_states, strict=True):
        opened.page.evaluate(f"player.show(nearest(DATA.time_s, {time_s!r}))")
        assert opened.shown_at() == f"t = {time_s:g}\xa0s"
        at = opened.page.evaluate("DATA.views[0].tracks[0].points[player.frame]")
        np.testing.assert_allclose(at, state[:3], rtol=1e-9, atol=1e-6)
    frame = 100
    opened.page.evaluate(f"player.show({frame})")
    moment = opened.page.evaluate(f"DATA.time_s[{frame}]")
    size = np.linalg.norm(path.control(np.array([moment])))
    assert numbers(rows(opened, 0)["|u|"]) == pytest.approx([size * 1e3], rel=SIX_DIGITS)


def test_the_tube_holds_the_flights_and_a_control_can_be_chosen(
    open_page: Open, pages: dict[str, str], reports: dict[str, Any]
) -> None:
    opened = open_page(pages["reach"])
    page = opened.page
    report = reports["reach"]
    periods = report.rendezvous.problem.periods
    for t in range(1, periods):
        page.evaluate(f"player.show({24 * t})")
        assert page.evaluate("DATA.views[0].sets.of_frame[player.frame]") == t
        corners = np.array(
            [each for face in page.evaluate(f"DATA.views[0].sets.faces[{t}]") for each in face]
        )
        np.testing.assert_allclose(corners.min(axis=0), report.tube[t, :3, 0], rtol=1e-6, atol=1e-3)
        np.testing.assert_allclose(corners.max(axis=0), report.tube[t, :3, 1], rtol=1e-6, atol=1e-3)
    page.get_by_role("combobox", name="Control").select_option("l1")
    page.evaluate("player.show(30)")
    shown = rows(opened, 0)
    (member,) = [each for each in report.members if each.name == "l1"]
    found = [numbers(shown[f"u{axis}, l1"])[0] for axis in "xyz"]
    wanted = report.rendezvous.acceleration_m_s2 * member.controls[1]
    assert found == pytest.approx(wanted, rel=SIX_DIGITS, abs=1e-10)
    assert not any("energy" in name for name in shown)
