"""What notebooks show: well-formed, small, without scripts, and true to the numbers."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from experiments.interception.scenario_file import load_scenario
from infoset import ConvexPolygons, InformationSet, SetModel
from infoset.svg import ticks
from sim import Record, Results, fly_one, simulate

MOST_BYTES = 40_000
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def model() -> SetModel:
    return load_scenario("asteroid-1997").set_model


@pytest.fixture(scope="module")
def record() -> Record:
    return fly_one(load_scenario("asteroid-1997-single"))


@pytest.fixture(scope="module")
def results() -> Results:
    return simulate(load_scenario("asteroid-1997"), runs=4)


def parsed(svg: str) -> Xml.Element:
    assert len(svg) < MOST_BYTES
    assert not re.search(r"<script|href|url\(|on\w+=", svg)
    return Xml.fromstring(svg)


def closed_paths(root: Xml.Element) -> list[Xml.Element]:
    return [each for each in root.iter(f"{SVG}path") if each.attrib["d"].endswith("Z")]


def test_a_set_shows_up_to_nine_of_its_sections(model: SetModel) -> None:
    information = InformationSet(model)
    root = parsed(information._repr_svg_())
    assert len(closed_paths(root)) == 9
    assert "29 sections at t = 0 s" in "".join(root.itertext())
    assert "µrad/s" in "".join(root.itertext())
    information.measure_angle(0.5)  # nothing agrees with it
    assert "sections at t = 0 s" in "".join(parsed(information._repr_svg_()).itertext())
    assert "the first of 3 engagements" in InformationSet(model, 3)._repr_svg_()


def test_a_section_is_drawn_where_it_is(model: SetModel) -> None:
    section = InformationSet(model).sections()[0]
    root = parsed(section._repr_svg_())
    (path,) = closed_paths(root)
    places = np.array(re.findall(r"([\d.]+) ([\d.]+)", path.attrib["d"]), dtype=float)
    outline = section.omega_alpha.polygon()
    # Right is greater omega, up is greater alpha, and both are in proportion.
    across, up = outline[:, 0] - outline[0, 0], outline[:, 1] - outline[0, 1]
    assert np.corrcoef(places[:, 0], across)[0, 1] == pytest.approx(1.0, abs=1e-6)
    assert np.corrcoef(places[:, 1], up)[0, 1] == pytest.approx(-1.0, abs=1e-6)


def test_predicted_misses_show_their_ends(model: SetModel) -> None:
    miss = InformationSet(model).predicted_miss()
    text = "".join(parsed(miss._repr_svg_()).itertext())
    assert f"{miss.lower_m[0]:.4g} to {miss.upper_m[0]:.4g} m" in text
    none = replace(miss, exists=np.array([False]))
    assert "no set is left" in none._repr_svg_()


@pytest.mark.parametrize(
    "polygons",
    [
        ConvexPolygons.from_points([]),
        ConvexPolygons.from_points([(1.0, 2.0)]),
        ConvexPolygons.from_points([(1.0, 2.0), (3.0, 2.0)]),
        ConvexPolygons(np.zeros((2, 3, 4, 2)), np.ones((2, 3))),
        ConvexPolygons(1e-300 * np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]), 3),
    ],
)
def test_any_polygon_has_a_picture(polygons: ConvexPolygons) -> None:
    picture = parsed(polygons._repr_svg_())
    assert picture.tag == f"{SVG}svg"
    assert not re.search(r"\b(nan|inf)", polygons._repr_svg_())


def test_an_engagement_shows_its_course(record: Record) -> None:
    text = record._repr_html_()
    assert len(text) < MOST_BYTES
    assert f"{record.result.miss_m[0]:.4g} m" in text
    table, miss, impulses = re.split(r"(?=<svg)", text)
    assert "asteroid-1997-single" in table
    assert len(closed_paths(parsed(miss))) == 1
    given = sum(step.impulse_m_s != 0.0 for step in record.steps)
    assert len([each for each in parsed(impulses).iter(f"{SVG}path") if each.attrib.get("fill") == "none"]) == given


def test_html_in_a_name_is_text(record: Record) -> None:
    bad = "</td><script>alert(1)</script>"
    text = replace(record, scenario=replace(record.scenario, name=bad), strategy=bad, noise=bad)._repr_html_()
    assert "<script" not in text
    assert text.count("&lt;script&gt;") == 3


def test_results_show_their_quantiles(results: Results) -> None:
    text = results._repr_html_()
    for level in (0.1, 0.5, 0.9):
        assert f"<td>{np.quantile(results.miss_m, level):.4g}</td>" in text
    assert f"{int(results.truth_kept.sum())} of 4" in text
    assert "<script" not in text


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3e-9, 5e-9), (1e5, 1.0001e5), (-7.0, 1e6)])
def test_ticks_are_round_and_inside(low: float, high: float) -> None:
    found = ticks(low, high)
    assert 2 <= len(found) <= 11
    assert low - 1e-9 * (high - low) <= found[0] < found[-1] <= high + 1e-9 * (high - low)
    steps = np.diff(found)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
    assert float(f"{steps[0]:.3e}"[0]) in (1.0, 2.0, 5.0)
