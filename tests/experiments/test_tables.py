"""Tables and lines of the rendezvous problems: complete numbers, each column with its unit."""

from __future__ import annotations

import re

import pytest

from tests.experiments.command_line import Command


@pytest.mark.parametrize(
    ("line", "patterns"),
    [
        (
            "pursuit",
            [
                r"captured at 45343\.620266 s \(12\.5955 h\)",
                r"^x +-39420.497090 +0.250766441 +1.612976850 +1.436953246$",
                r"0\.0503 and 0\.6958 times 42166 km",
            ],
        ),
        (
            "reach --select energy --replan",
            [
                r"^control +u\^2 +u +m/s +\(m, m/s\) +periods$",
                r"nonlinear miss [\d.]+ \(m, m/s\), Delta-v [\d.]+ m/s$",
            ],
        ),
        ("multipoint asteroid-tour", [r"^target +meet +days ", r"^Itokawa +flyby +265 "]),
    ],
)
def test_tables_of_a_command_have_units(line: str, patterns: list[str], infoset: Command) -> None:
    code, out, _ = infoset(*line.split())
    assert code == 0
    for pattern in patterns:
        assert re.search(pattern, out, re.MULTILINE), pattern
