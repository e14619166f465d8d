"""The axes that the four problems of relative motion state, and the check of their orbits."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.experiments.common.hill_axes import from_paper, to_paper
from infoset.experiments.common.input_file import load_problem
from tests.experiments.command_line import Command


def test_axes_of_the_papers_are_converted_both_ways() -> None:
    # 7 m outward, 3 m ahead, 2 m along the normal; the papers have x against the motion, y outward.
    assert to_paper([7.0, 3.0, 2.0, 0.7, 0.3, 0.2]).tolist() == [-3.0, 7.0, 2.0, -0.3, 0.7, 0.2]
    assert from_paper([[-3.0, 7.0, 2.0], [3.0, 0.0, 0.0]]).tolist() == [
        [7.0, 3.0, 2.0],
        [0.0, -3.0, 0.0],
    ]
    # The published initial state.
    printed = [2650.0, -2540.0, 2120.0, -3.0, 2.0, 3.0]
    assert to_paper(load_problem("rendezvous-2021").problem.initial).tolist() == printed


@pytest.mark.parametrize(
    ("command", "problem", "settings", "key"),
    [
        ("reach", "rendezvous-2021", ["orbit.semi_major_axis_km={}"], "orbit: semi_major_axis_m"),
        ("pareto", "pareto-2008", ["orbit_rate_rad_s={rate}"], "orbit_rate_rad_s"),
        ("pursuit", "leo-pursuit", ["pursuer.orbit.semi_major_axis_km={}"], "pursuer"),
    ],
)
def test_an_orbit_inside_the_earth_is_refused(
    infoset: Command, command: str, problem: str, settings: list[str], key: str
) -> None:
    rate = np.sqrt(3.986004418e14 / 418e3**3)
    options = [part for each in settings for part in ("--set", each.format(418.0, rate=rate))]
    assert f"{key}: the orbit meets the planet" in infoset.refused(command, problem, *options)
