"""Tables of the rendezvous problems on a screen of 60 columns: complete numbers, each column with its unit."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def narrow(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Run a command on a screen of 60 columns, and return what it prints."""
    monkeypatch.setenv("COLUMNS", "60")

    def run(line: str) -> str:
        code, out, _ = infoset(*line.split())
        assert code == 0
        return out

    return run


@pytest.mark.parametrize(
    "line",
    [
        "problems",
        "reach rendezvous-2021",
        "reach approach-cone --select energy",
        "multipoint service-5",
        "pareto --prefer x_m=0,z_m=50",
        "pursuit",
        "pursuit-map --x phase_deg=-20:20:2 --y thrust_ratio=0.2:0.5:2",
    ],
)
def test_no_digit_is_cut(line: str, narrow: Callable[[str], str]) -> None:
    out = narrow(line)
    assert "…" not in out
    assert not re.search(r"\d\.$", out, re.MULTILINE)


def test_vectors_of_a_capture_are_columns(narrow: Callable[[str], str]) -> None:
    out = narrow("pursuit")
    assert "captured at 45343.620266 s (12.5955 h)" in out
    assert "continuation" not in out
    assert re.search(r"^x +-39420.497090 +0.250766441 +1.612976850 +1.436953246$", out, re.MULTILINE)
    assert re.search(r"^z +604.130676 +0.058574134", out, re.MULTILINE)
    assert "0.05030 and 0.69579 times 42166 km" in out


def test_a_wide_table_is_printed_in_parts_with_its_names(narrow: Callable[[str], str]) -> None:
    out = narrow("multipoint service-5")
    assert len(re.findall(r"^bravo +rendezvous ", out, re.MULTILINE)) == 2
    assert "1845.694519" in out


def test_tables_of_reach_have_units(infoset: Infoset) -> None:
    out = infoset("reach", "--select", "energy", "--replan")[1]
    assert re.search(r"^period +m +m +m$", out, re.MULTILINE)
    assert re.search(r"^control +u\^2 +u +u +u +m/s +m/s +m/s +m/s", out, re.MULTILINE)
    assert re.search(r"^control.* +\(m, m/s\)", out, re.MULTILINE)
    assert "controls u are in units of 0.15 m/s^2" in out
    assert re.search(r"nonlinear miss [\d.]+ \(m, m/s\), Delta-v [\d.]+ m/s$", out, re.MULTILINE)


def test_times_are_in_days_where_the_figures_are(infoset: Infoset) -> None:
    out = infoset("multipoint", "asteroid-tour")[1]
    assert re.search(r"^target +meet +days ", out, re.MULTILINE)
    assert re.search(r"^Itokawa +flyby +265 ", out, re.MULTILINE)


def test_capture_times_of_a_map_are_in_hours_as_in_its_figure(infoset: Infoset) -> None:
    out = infoset("pursuit-map", "--x", "phase_deg=-20:20:2", "--y", "thrust_ratio=0.2:0.5:2")[1]
    assert re.search(r"^capture times from \d+\.\d{4} to \d+\.\d{4} h$", out, re.MULTILINE)


def test_misses_of_simulations_with_feedback_are_printed(infoset: Infoset) -> None:
    out = infoset("pursuit", "leo-pursuit", "--feedback", "random", "--runs", "2")[1]
    assert re.search(r"^  capture time, s: smallest [\d.]+, median [\d.]+, largest [\d.]+$", out, re.MULTILINE)
    assert re.search(r"^  distance at the end, m: smallest [\d.]+, median [\d.]+, largest [\d.]+$", out, re.MULTILINE)
