"""`infoset reach` for a linear system: the double integrator, whose fastest and cheapest controls
are known.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from tests.experiments.command_line import Command

CART = "double-integrator"


def farthest(periods: int) -> float:
    """Distance between two rests with |u| <= 1: full force forward in the first half, backward in
    the second.
    """
    return (periods**2 - periods % 2) / 4.0


@pytest.mark.parametrize("periods", range(2, 9))
def test_the_fastest_stop(periods: int, infoset: Command) -> None:
    for distance, least in ((farthest(periods), periods), (farthest(periods) + 1e-6, None)):
        settings = (f"periods={periods}", f"initial=[{-distance!r}, 0]", "bounds.states=[100, 100]")
        found = infoset.json(
            "reach", CART, *(part for setting in settings for part in ("--set", setting))
        )
        assert found["min_periods"] == least
        assert (found["optimal_miss"] == 0.0) == (least is not None)


def test_reachable_states_and_the_cheapest_control(infoset: Command) -> None:
    settings = ("--set", "bounds.states=[100, 100]", "--select", "energy")
    found = infoset.json("reach", CART, *settings)
    assert found["route"] == "exact"
    for each in found["sets"]:
        t = each["period"]
        np.testing.assert_allclose(each["forward"]["max"], [-5.0 + t * t / 2.0, t], atol=1e-9)
        np.testing.assert_allclose(each["forward"]["min"], [-5.0 - t * t / 2.0, -t], atol=1e-9)
        # A zonotope of t segments that are not parallel.
        assert each["forward"]["vertices"] == each["forward"]["facets"] == 2 * t
    # The control of minimum energy is linear in time: u(t) = k (T - 1 - 2 t) with the sum (T - t -
    # 1/2) u(t) = 5.
    times = np.arange(6)
    shape = 5.0 - 2.0 * times
    wanted = 5.0 * shape / ((5.5 - times) @ shape)
    np.testing.assert_allclose(np.ravel(found["controls"][0]["controls"]), wanted, atol=1e-8)
    np.testing.assert_allclose(found["controls"][0]["states"][-1], [0.0, 0.0], atol=1e-8)


def test_an_offset_and_a_target(infoset: Command) -> None:
    """A cart on a slope: c is half and once the acceleration of gravity along it, which the force
    can cancel.
    """
    settings = (
        "system.c=[-0.15, -0.3]",
        "target=[1.0, 0.0]",
        "initial=[1.0, 0.0]",
        "bounds.controls=[0.3]",
    )
    arguments = [part for setting in settings for part in ("--set", setting)]
    found = infoset.json("reach", CART, *arguments, "--select", "energy")
    assert found["optimal_miss"] == pytest.approx(0.0, abs=1e-9)
    # Only the greatest force holds the cart, and every other control lets it slide.
    np.testing.assert_allclose(np.ravel(found["controls"][0]["controls"]), 0.3, atol=1e-8)
    for each in found["sets"]:
        np.testing.assert_allclose(
            [each["tube"]["min"], each["tube"]["max"]], [[1.0, 0.0]] * 2, atol=1e-8
        )
    rows = list(csv.DictReader(io.StringIO(infoset("reach", CART, *arguments, "--csv", "-")[1])))
    assert [row["u1"] for row in rows[:7]][-1] == ""
    assert float(rows[6]["x1"]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("system.A=[[1, 2]]", "system.A: must have 1 x 1 values"),
        ("system.B=[[1, 2], [3, 4]]", "system.B: must have 2 x 1 values"),
        ("initial=[1]", "initial: must have 2 values, for 2 states and 1 controls"),
        ("initial=[-7, 0]", "the initial state is outside its constraints: position, m by 1"),
        ("bounds.controls=[0]", "bounds.controls"),
        ("target=[1, 1]", "target"),
    ],
)
def test_wrong_systems_are_refused(setting: str, told: str, infoset: Command) -> None:
    extra = ("--set", "system.A=[[0, 0], [0, 0]]") if setting.startswith("target") else ()
    assert told in infoset.refused("reach", CART, "--set", setting, *extra)


def test_options_of_a_rendezvous_are_refused(infoset: Command) -> None:
    assert "are for problems of kind reachable-rendezvous" in infoset.refused(
        "reach", CART, "--replan"
    )


def test_kind_of_a_file_selects_the_computation(infoset: Command) -> None:
    Path("mine.toml").write_text('kind = "observer"\nname = "x"\n')
    assert "use infoset observe" in infoset.refused("reach", "mine.toml")
