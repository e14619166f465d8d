"""The replay page in a browser: time, hover, two records, small screens, hostile names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments.interception.page import interception_page
from infoset.sim import Record
from tests.browser.conftest import Opened, numbers

Open = Callable[..., Opened]
STEP = 120
MEASURED = 4 * 120 + 1
SIX_DIGITS = 5e-6


@pytest.fixture(scope="module")
def single(records: list[Record]) -> str:
    return interception_page(records[1:])


@pytest.fixture(scope="module")
def pair(records: list[Record]) -> str:
    return interception_page(records)


def test_slider_and_keys_move_the_time(open_page: Open, single: str, records: list[Record]) -> None:
    opened = open_page(single)
    page = opened.page
    last = 4 * records[1].steps - 1
    assert opened.shown_at() == "t = 0 s, before the measurement"
    page.keyboard.press("ArrowRight")
    assert opened.shown_at() == "t = 0 s, after the measurement"
    page.keyboard.press("Shift+ArrowRight")
    assert opened.shown_at() == "t = 0.5 s, after the measurement"
    page.keyboard.press("ArrowLeft")
    assert opened.shown_at() == "t = 0.5 s, before the measurement"
    page.keyboard.press("End")
    assert opened.shown_at() == f"t = {records[1].time_s[-1]:g} s, after the prediction"
    assert page.evaluate("player.frame") == last
    page.keyboard.press("Home")
    slider = page.get_by_role("slider", name="Time")
    slider.focus()
    page.keyboard.press("ArrowRight")  # the slider's own key: one stage, not two
    assert page.evaluate("player.frame") == 1
    slider.fill(str(MEASURED))
    assert opened.shown_at() == "t = 60 s, after the measurement"
    assert slider.get_attribute("aria-valuetext") == opened.shown_at()


def test_it_plays_and_pauses(open_page: Open, single: str) -> None:
    opened = open_page(single)
    page = opened.page
    page.keyboard.press(" ")
    assert page.get_by_role("button", name="Pause").is_visible()
    opened.until("player.frame > 8")
    page.keyboard.press(" ")
    held = page.evaluate("player.frame")
    page.wait_for_timeout(200)
    assert page.evaluate("player.frame") == held
    page.get_by_label("Steps/s").select_option("30")
    page.evaluate("player.show(player.frames - 40)")
    page.get_by_role("button", name="Play").click()
    opened.until("player.frame === player.frames - 1")
    assert page.get_by_role("button", name="Play").is_visible()  # it stops by itself
    page.get_by_role("button", name="Play").focus()
    page.keyboard.press("Enter")
    opened.until("player.playing && player.frame < 100")  # from the start again


def test_hover_shows_the_records_numbers(
    open_page: Open, single: str, records: list[Record]
) -> None:
    opened = open_page(single)
    record = records[1]
    time_s = float(record.time_s[STEP])
    opened.page.evaluate(f"player.show({MEASURED})")

    opened.point_at("columns[0].miss", f"[columns[0].miss.across({time_s}), 60]")
    time, lower, upper, truth = numbers(opened.tip())
    velocity_x_m_s = records[1].result.velocity_m_s[0, -1]
    passing_m = -record.true_rate_rad_s[STEP, 0] * record.true_range_m[STEP] ** 2 / velocity_x_m_s
    assert [time, lower, upper, truth] == pytest.approx(
        [time_s, *record.predicted_miss_m[STEP, 0], passing_m], rel=SIX_DIGITS
    )

    opened.point_at("columns[0].impulses", f"[columns[0].impulses.across({time_s}), 60]")
    time, impulse, left = numbers(opened.tip())
    spent = np.abs(record.impulse_m_s[: STEP + 1]).sum()
    assert [time, impulse] == pytest.approx([time_s, record.impulse_m_s[STEP, 0]], rel=SIX_DIGITS)
    assert left == pytest.approx(records[1].scenario.thruster.budget_m_s - spent, rel=SIX_DIGITS)

    opened.point_at(
        "columns[0].plane",
        "(({ plane, truth, limits: { rateUnit, angleUnit } }) =>"
        " [plane.across(truth.rate * rateUnit[1]), plane.up(truth.angle * angleUnit[1])])"
        "(columns[0])",
    )
    rate, angle, range_km = numbers(opened.tip())
    assert "µrad/s" in opened.tip()
    factor = 1e6 if "µrad\n" in opened.tip() else 1e3
    assert rate == pytest.approx(record.true_rate_rad_s[STEP, 0] * 1e6, rel=SIX_DIGITS)
    assert angle == pytest.approx(record.true_angle_rad[STEP, 0] * factor, rel=SIX_DIGITS)
    assert range_km == pytest.approx(record.true_range_m[STEP] / 1e3, rel=SIX_DIGITS)


def test_outlines_are_the_records_within_a_pixel(
    open_page: Open, single: str, records: list[Record]
) -> None:
    opened = open_page(single)
    for step in (0, 50, STEP, 200):
        opened.page.evaluate(f"player.show({4 * step + 1})")
        found = opened.page.evaluate("columns[0].sections.map((section) => section.points)")
        recorded = [section.omega_alpha[0].polygon() for section in records[1].sections[step]]
        assert [len(outline) for outline in found] == [len(outline) for outline in recorded]
        for outline, wanted in zip(found, recorded, strict=True):
            width = wanted.max(axis=0) - wanted.min(axis=0)
            assert (
                np.abs(np.array(outline) - wanted) <= 1e-5 * width + 1e-15 * np.abs(wanted)
            ).all()


def test_the_stages_follow_from_each_other(
    open_page: Open, single: str, records: list[Record]
) -> None:
    opened = open_page(single)
    impulse_m_s = records[1].impulse_m_s[STEP, 0]
    extents = []
    for stage in range(4):
        opened.page.evaluate(f"player.show({4 * STEP + stage})")
        extents.append(
            opened.page.evaluate(
                "columns[0].sections.map(({ label, range, box }) => [label, range, ...box])"
            )
        )
    before, measured, fired, predicted = (np.array(each) for each in extents)
    after = np.array([each for each in before if each[0] in measured[:, 0]])
    assert (
        after[:, 2] <= measured[:, 2] + 1e-15
    ).all()  # a measurement takes away, and adds nothing
    assert (after[:, 4] >= measured[:, 4] - 1e-15).all()
    assert impulse_m_s != 0.0
    np.testing.assert_allclose(
        fired[:, 2], measured[:, 2] - impulse_m_s / measured[:, 1], rtol=1e-12
    )
    model = records[1].scenario.set_model
    nearer = model.closing_speed_m_s * model.step_s
    np.testing.assert_allclose(predicted[:, 1], fired[-len(predicted) :, 1] - nearer, rtol=1e-12)


def test_two_records_side_by_side(
    open_page: Open, pair: str, records: list[Record], screenshots: Path
) -> None:
    opened = open_page(pair)
    page = opened.page
    page.evaluate(f"player.show({MEASURED})")
    titles = page.locator("h2").all_inner_texts()
    assert titles == ["(a) random noise, range sensor", "(b) game noise, range sensor"]
    left, right = (
        page.evaluate(f"columns[{k}].plane.canvas.getBoundingClientRect().left")
        for k in range(len(records))
    )
    assert right > left + 400
    for column, record in enumerate(records):
        rows = dict(
            zip(
                *[iter(page.locator("table").nth(column).locator("th, td").all_inner_texts())] * 2,
                strict=True,
            )
        )
        assert numbers(rows["predicted miss"]) == pytest.approx(
            record.predicted_miss_m[STEP, 0], rel=SIX_DIGITS
        )
        assert numbers(rows["true range"]) == pytest.approx(
            [record.true_range_m[STEP] / 1e3], rel=SIX_DIGITS
        )
    assert page.evaluate("columns[0].limits === columns[1].limits")
    page.get_by_label("Axes").select_option("each its own")
    assert page.evaluate("columns[0].limits.rates[1] < columns[1].limits.rates[1]")
    page.screenshot(path=screenshots / "interception-pair.png", full_page=True)


HOSTILE = "<img src=x onerror=alert(1)>"
CLOSING = "</script><script>alert(2)</script>\u2028<!--<script>"


def test_html_in_names_is_text(open_page: Open, records: list[Record], screenshots: Path) -> None:
    record = records[0]
    scenario = replace(record.scenario, name=HOSTILE, description=CLOSING)
    bad = replace(
        record, scenario=scenario, strategy=f"{HOSTILE}&amp;", noise=f"{CLOSING}{HOSTILE}"
    )
    html = interception_page([bad, records[1]])
    assert HOSTILE not in html
    assert CLOSING not in html
    opened = open_page(html)
    page = opened.page
    assert page.locator("h1").inner_text() == f"Replay of {HOSTILE} and {records[1].scenario.name}"
    assert page.title() == f"Replay of {HOSTILE} and {records[1].scenario.name}"
    assert "</script><script>alert(2)</script>" in page.locator("#about").inner_text()
    assert f"{HOSTILE}&amp; strategy" in page.locator("main").inner_text()
    assert page.evaluate("document.images.length") == 0
    page.wait_for_timeout(100)
    page.screenshot(path=screenshots / "interception-hostile.png")


def test_the_policy_stops_what_is_not_the_pages_own(open_page: Open, single: str) -> None:
    opened = open_page(single)
    ran = opened.page.evaluate(
        "(() => { const bad = document.createElement('script'); bad.textContent = 'window.ran = 1';"
        " document.body.append(bad); return window.ran ?? 0; })()"
    )
    assert ran == 0
    fetched = opened.page.evaluate("fetch('https://example.org/').then(() => 1, () => 0)")
    assert fetched == 0
    assert len(opened.console) >= 2
    assert all(
        "Content Security Policy" in message or "Fetch" in message for message in opened.console
    )
    opened.console.clear()
    opened.requests[:] = opened.requests[:1]
