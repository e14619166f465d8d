from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.experiments.common.input_file import load_problem
from infoset.rendezvous.multipoint import KeplerTour, Meet, TourTarget
from tests.built_in import problem_text
from tests.experiments.command_line import Command

TWO, THREE, TOUR = (problem_text(name) for name in ("service-2", "service-3", "asteroid-tour"))
HEAD = THREE.split("[[target]]")[0]
ORBIT = "orbit_rate_rad_s = 1.13e-3"


def changed(old: str, new: str, text: str = THREE) -> str:
    """A problem with its first `old` replaced."""
    assert old in text
    return text.replace(old, new, 1)


LOCAL_MINIMUM = (
    r"the times are a local minimum, the lowest one found by \d+ descents from the best of \d+ "
    r"starting points on a grid of \d+ times, \d+ a revolution"
)
OPTIMISED = changed("optimise_times = false", "optimise_times = true")


def found(infoset: Command, *arguments: object) -> Any:
    return infoset.json("multipoint", *arguments, "-q")


def targets(count: int, apart_s: float = 500.0) -> str:
    """A file of so many targets."""
    table = (
        '[[target]]\nname = "n{0}"\nposition_m = [{0}, 10, 0]\n'
        "velocity_m_s = [0, 0, 0]\ntime_s = {1}\n"
    )
    return HEAD + "".join(table.format(each, apart_s * (each + 1)) for each in range(count))


def test_three_targets(infoset: Command) -> None:
    results = found(infoset, "service-3")
    assert (results["order_chosen"], results["times_chosen"], results["evaluations"]) == (
        "given",
        "given",
        1,
    )
    # The acceptance, N = 3.
    assert results["cost_m2_s3"] == pytest.approx(0.021142280110555873, rel=1e-9)
    assert results["order"] == ["T1", "T2", "T3"]
    assert results["times_s"] == [1200.0, 2600.0, 4000.0]
    _, out, _ = infoset("multipoint", "service-3")
    for piece in ("I = 0.02114228", "T1", "flyby", "dI/dt", "costate jump", "m^2/s^4"):
        assert piece in out


def test_order_and_times_override_the_file(infoset: Command, mine: Callable[[str], Path]) -> None:
    best = found(infoset, "service-3", "--times", "best")
    assert best["times_chosen"] == "best"
    (note,) = best["notes"]
    assert re.fullmatch(LOCAL_MINIMUM, note)
    assert best["cost_m2_s3"] == pytest.approx(0.01835844971766454, rel=1e-9)
    both = found(infoset, "service-3", "--order", "best", "--times", "best")
    assert both["order"] == ["T3", "T2", "T1"]
    assert both["cost_m2_s3"] == pytest.approx(0.008734876263, rel=1e-9)
    of_order, of_times = both["notes"]
    assert of_order.endswith("searched again: the order is the best one found")
    assert re.fullmatch(LOCAL_MINIMUM, of_times)
    slots = found(infoset, "service-3", "--order", "best")
    assert slots["times_s"] == [1200.0, 2600.0, 4000.0]
    assert slots["notes"] == ["no order that fits the times costs less"]
    assert slots["time_search"] is None
    assert slots["cost_m2_s3"] <= 0.0211422802
    assert found(infoset, mine(OPTIMISED))["cost_m2_s3"] == pytest.approx(
        best["cost_m2_s3"], rel=1e-12
    )
    given = found(infoset, mine(OPTIMISED), "--times", "given")
    assert given["cost_m2_s3"] == pytest.approx(0.021142280110555873, rel=1e-9)


@pytest.mark.parametrize("order", ["given", "best"])
def test_price_of_given_times_is_part_of_the_cost_with_price(
    infoset: Command, mine: Callable[[str], Path], order: str
) -> None:
    file = mine(changed("latest_s = 3000.0", "price_per_s = 1e-6", TWO))
    visits = found(infoset, file, "--order", order, "--times", "given")
    assert visits["cost_with_price_m2_s3"] == pytest.approx(
        visits["cost_m2_s3"] + 1e-6 * visits["times_s"][-1]
    )


def test_rendezvous_prices_and_eccentric_orbits(
    infoset: Command, mine: Callable[[str], Path]
) -> None:
    met = found(infoset, "service-3", "--set", "target.3.meet=rendezvous")
    assert met["nodes"][-1]["velocity_m_s"] == met["nodes"][-1]["target_velocity_m_s"]
    priced = found(
        infoset, mine(changed("latest_s = 3000.0", "price_per_s = 1e-6", TWO)), "--times", "best"
    )
    assert priced["cost_with_price_m2_s3"] == pytest.approx(
        priced["cost_m2_s3"] + 1e-6 * priced["times_s"][-1]
    )
    # A nearly circular orbit is nearly the circular one, wherever the craft is on it.
    for anomaly_deg in (0, 200):
        orbit = ("--set", "eccentricity=1e-7", "--set", f"true_anomaly_deg={anomaly_deg}")
        near = found(infoset, "service-3", *orbit)
        assert near["cost_m2_s3"] == pytest.approx(0.021142280110555873, rel=1e-4)


def test_a_chaser_that_is_at_its_target_costs_nothing(
    infoset: Command, mine: Callable[[str], Path]
) -> None:
    target = 'name = "T1"\nposition_m = [0, 0, 0]\nvelocity_m_s = [0, 0, 0]\nmeet = "rendezvous"'
    text = f"{HEAD}[[target]]\n{target}\n[times]\nlatest_s = 3000.0\n"
    assert found(infoset, mine(changed("= false", "= true", text)))["cost_m2_s3"] == 0.0


def test_the_asteroid_tour(infoset: Command, mine: Callable[[str], Path]) -> None:
    results = found(infoset, "asteroid-tour")
    assert results["order"] == ["Itokawa", "Bennu", "Ryugu"]
    assert "inertial" in results["units"]
    problem = load_problem("asteroid-tour")
    assert problem.times_s is not None
    where = problem.tour.target_states(np.arange(3), problem.times_s)
    for node, state in zip(results["nodes"], where, strict=True):
        np.testing.assert_allclose(node["position_m"], state[:3], rtol=1e-9)
        assert 0.9 < np.linalg.norm(state[:3]) / 1.495978707e11 < 1.7
    # Elements or the state they mean: the same.
    position, velocity = (part.tolist() for part in np.split(problem.tour.start_state / 1e3, 2))
    elements = TOUR[TOUR.index("[chaser.elements]") : TOUR.index("[[target]]")]
    state = changed(
        elements, f"[chaser]\nposition_km = {position}\nvelocity_km_s = {velocity}\n", TOUR
    )
    assert found(infoset, mine(state))["cost_m2_s3"] == pytest.approx(
        results["cost_m2_s3"], rel=1e-9
    )


def test_five_targets_as_listed(infoset: Command) -> None:
    results = found(infoset, "service-5")
    assert results["times_chosen"] == "best"
    leave = [each["leave_s"] for each in results["nodes"]]
    assert leave[2] == pytest.approx(results["times_s"][2] + 300.0)
    assert (
        np.array(results["times_s"]) - np.array([0.0, *leave[:-1]]) >= 600.0 * (1.0 - 1e-9)
    ).all()
    gradient = results["time_gradient_m2_s4"]
    assert max(abs(each) for each in gradient[:-1]) < 1e-6 * abs(gradient[-1])


FLYBYS = """
kind = "multipoint"
name = "flybys"
orbit_rate_rad_s = 0.0001981097250033099
optimise_times = true
[chaser]
position_m = [-149.27524597582467, 188.63224956544803, 0.0]
velocity_m_s = [0.0, 0.0, 0.0]
[[target]]
name = "A"
position_m = [-319.12593149170374, 56.97653467447365, -138.41578296704205]
velocity_m_s = [0.023090731020511596, 0.1264439010584931, -0.014515600457438747]
time_s = {}
[[target]]
name = "B"
position_m = [170.37446011332898, -1229.8807955827706, -457.77364640130816]
velocity_m_s = [0.018522882623050834, -0.067505674881278, -0.0129640304776907]
time_s = {}
[times]
latest_s = {}
min_gap_s = 1514.3
"""
"""Two flybys within 4.77 revolutions, with many local minima."""


@pytest.mark.parametrize(
    ("latest_s", "is_coarse"),
    [
        (31000.0, False),
        (151431.23337079378, False),
        pytest.param(2.0e6, True, marks=pytest.mark.thorough),
    ],
)
def test_search_of_best_times_reports_its_grid(
    infoset: Command, mine: Callable[[str], Path], latest_s: float, is_coarse: bool
) -> None:
    file = mine(FLYBYS.format(0.4 * latest_s, 0.8 * latest_s, latest_s))

    results = found(infoset, file)
    _, screen, _ = infoset("multipoint", file, "--html", file.with_suffix(".html"))

    search = results["time_search"]
    revolutions = 0.0001981097250033099 * latest_s / (2.0 * np.pi)
    assert search["revolutions"] == pytest.approx(revolutions, rel=1e-12)
    grid = search["grid"]
    assert grid["until_s"] == latest_s
    assert grid["per_revolution"] == pytest.approx(grid["times"] / revolutions, rel=1e-12)
    assert (grid["per_revolution"] < 20.0) == is_coarse
    words = (
        f"found by {search['followed']} descents from the best of {search['starts']} starting "
        f"points on a grid of {grid['times']} times, {grid['per_revolution']:.2g} a revolution"
    )
    page = file.with_suffix(".html").read_text()
    for text in (" ".join(screen.split()), " ".join(results["notes"]), page):
        assert words in text
        assert ("the grid is coarse" in text) == is_coarse


def test_best_order_is_compared_on_a_grid(infoset: Command, mine: Callable[[str], Path]) -> None:
    file = mine(FLYBYS.format(60000.0, 120000.0, 151431.23337079378))
    results = found(infoset, file, "--order", "best")
    # The lower of the two orders' lowest known costs.
    assert results["cost_m2_s3"] <= 4.634e-8
    assert results["order"] == ["A", "B"]
    search = results["order_search"]
    assert search["orders_searched_again"] == 2
    assert (
        f"all orders were compared on a grid of {search['grid']['times']} times"
        in results["notes"][0]
    )


@pytest.mark.thorough
def test_best_times_over_several_revolutions_are_reported_as_uncertain(
    infoset: Command,
) -> None:
    results = found(infoset, "asteroid-tour", "--times", "best")
    assert results["time_search"]["grid"] is None
    assert (
        "revolutions there are many local minima, and others are often lower"
        in results["notes"][-1]
    )


def test_given_times_are_not_searched(infoset: Command) -> None:
    results = found(infoset, "service-3")
    assert (results["time_search"], results["notes"]) == (None, [])


CHASER = "[chaser]\nposition_km = [12000.0, 2000.0, 0.0]\nvelocity_km_s = [{0}, {1}, 0.0]\n"
CIRCLE_KM_S = 6.3134811459289
"""Speed on a circle of 10 000 km about the Earth."""


def published(chaser: str) -> str:
    """A rendezvous with a station on a circle of 10 000 km after a radian, the gravity that of the
    Earth.
    """
    station = f"position_km = [10000.0, 0.0, 0.0]\nvelocity_km_s = [0.0, {CIRCLE_KM_S}, 0.0]\n"
    return (
        'kind = "multipoint"\nname = "published"\ngravitational_parameter_km3_s2 = 398600.4418\n'
        f'{chaser}[[target]]\nname = "station"\nmeet = "rendezvous"\ntime_s = 1583.912229856\n'
        f"{station}"
    )


def test_a_chaser_on_a_hyperbola(infoset: Command, mine: Callable[[str], Path]) -> None:
    # The published relative state 0.2, 0.2, 0.1, 0.1 was refused as no ellipse; its cost, with mu =
    # 1, is that of tests/rendezvous/multipoint/test_kepler.py.
    hyperbola = CHASER.format(-0.1 * CIRCLE_KM_S, 1.3 * CIRCLE_KM_S)
    unit_m2_s3 = (CIRCLE_KM_S * 1e3) ** 2 / (1e7 / (CIRCLE_KM_S * 1e3))
    start = np.array([1.2, 0.2, 0.0, -0.1, 1.3, 0.0])
    station = np.array([[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]])
    tour = KeplerTour((TourTarget("station", Meet.RENDEZVOUS),), station, np.zeros(1), 1.0, start)

    found_cost = found(infoset, mine(published(hyperbola)))["cost_m2_s3"]

    # The numbers of the file have 13 digits, and both paths 9.
    assert found_cost == pytest.approx(tour.fly((0,), [1.0]).cost * unit_m2_s3, rel=1e-8)


@pytest.mark.parametrize(
    ("chaser", "message"),
    [
        (CHASER.format(-7.0, 0.0), "chaser: the orbit meets the planet during the flight"),
        (
            CHASER.format(7.0, 0.0) + "epoch_s = 4000.0\n",
            "chaser: the orbit meets the planet during the flight",
        ),
        (
            "[chaser]\nposition_km = [0, 0, 0]\nvelocity_km_s = [1, 0, 0]\n",
            "chaser: the position is the centre",
        ),
    ],
)
def test_a_body_that_meets_the_planet_is_refused(
    chaser: str, message: str, infoset: Command, mine: Callable[[str], Path]
) -> None:
    assert message in infoset.refused("multipoint", mine(published(chaser)))


def test_a_planet_that_is_met_after_the_flight_does_not_matter(
    infoset: Command, mine: Callable[[str], Path]
) -> None:
    # Falls on the planet after 45 minutes.
    assert found(infoset, mine(published(CHASER.format(0.0, 2.0))))["cost_m2_s3"] > 0.0


@pytest.mark.parametrize(
    ("text", "options", "told"),
    [
        (
            changed("2600.0", "1200.0"),
            [],
            "times must increase: visit 2 is at 1200 s, not after 1200 s",
        ),
        (changed("time_s = 2600.0\n", ""), [], "--times given: needs time_s of every target"),
        (
            OPTIMISED.replace("time_s = 2600.0\n", ""),
            ["--times", "given"],
            "--times given: needs time_s",
        ),
        (
            changed("4000.0", "1e9"),
            [],
            "the last of time_s and latest_s is 1.13e+06 radians of the orbit",
        ),
        (
            changed(ORBIT, f"{ORBIT}\ngravitational_parameter_m3_s2 = 4e14"),
            [],
            "is needed, not both",
        ),
        (
            OPTIMISED.replace("latest_s = 4000.0", "latest_s = 1000.0\nmin_gap_s = 400.0"),
            [],
            "3 visits do not fit",
        ),
        (
            targets(120),
            ["--order", "best"],
            "--order best: takes at most 9 targets, and service-3 has 120",
        ),
        (changed('meet = "flyby"', "dwell_s = 5.0"), [], "target 'T1': a flyby cannot dwell"),
        (changed("132712440018.0", "1e-50", TOUR), [], "no trajectory was found"),
    ],
)
def test_unsound_problems_are_refused(
    text: str,
    options: list[str],
    told: str,
    infoset: Command,
    mine: Callable[[str], Path],
    tmp_path: Path,
) -> None:
    assert told in infoset.refused("multipoint", mine(text), *options, "--out", tmp_path / "out")
    assert [each.name for each in tmp_path.iterdir()] == ["mine.toml"]


def test_bound_above_the_peak_changes_nothing(infoset: Command) -> None:
    without = found(infoset, "service-3")
    bounded = found(
        infoset, "service-3", "--set", f"max_control_m_s2={without['peak_control_m_s2'] * 1.0001}"
    )
    assert bounded | {"problem_hash": ""} == without | {"problem_hash": ""}
    assert bounded["imposed_bound"] is None


def test_bound_below_the_peak_is_imposed(infoset: Command) -> None:
    without = found(infoset, "service-3")
    bounded = found(infoset, "service-3", "--set", "max_control_m_s2=0.005")
    _, screen, _ = infoset(
        "multipoint", "service-3", "--set", "max_control_m_s2=0.005", "--html", "page.html"
    )

    assert bounded["peak_control_m_s2"] == pytest.approx(0.005, rel=1e-9)
    assert bounded["cost_m2_s3"] > without["cost_m2_s3"]
    imposed = bounded["imposed_bound"]
    assert imposed["cost_without_m2_s3"] == without["cost_m2_s3"]
    assert imposed["peak_control_without_m_s2"] == without["peak_control_m_s2"]
    assert imposed["smallest_possible_m_s2"] < 0.005
    (note,) = bounded["notes"]
    assert note.startswith(
        "the bound of 0.005 m/s^2 is imposed: without it the cost is 0.02114228 m^2/s^3"
    )
    assert note in " ".join(screen.split())
    assert "0.005 m/s^2 is imposed" in Path("page.html").read_text()


def test_best_times_and_order_with_a_bound(infoset: Command) -> None:
    options = ("service-3", "--order", "best", "--times", "best")
    bounded = found(infoset, *options, "--set", "max_control_m_s2=0.004")

    assert bounded["peak_control_m_s2"] == pytest.approx(0.004, rel=1e-9)
    assert bounded["cost_m2_s3"] > found(infoset, *options)["cost_m2_s3"]
    gradient = bounded["time_gradient_m2_s4"]
    assert max(abs(each) for each in gradient[:-1]) < 1e-6 * abs(gradient[-1])
    assert "the order was chosen without the bound" in bounded["notes"]
    assert "the best times without the bound were improved with it" in bounded["notes"]


def test_bound_below_the_smallest_possible_one_is_refused(infoset: Command) -> None:
    err = infoset.refused("multipoint", "service-3", "--set", "max_control_m_s2=0.003")
    assert "no control of at most 0.003 m/s^2 makes the visits at these times" in err
    least = float(err.split("at least ")[1].split(" m/s^2")[0])
    just_above = found(infoset, "service-3", "--set", f"max_control_m_s2={1.001 * least}")
    assert just_above["peak_control_m_s2"] == pytest.approx(1.001 * least, rel=1e-9)
    close = infoset.refused(
        "multipoint", "service-3", "--set", f"max_control_m_s2={least * (1.0 + 1e-9)}"
    )
    assert "m/s^2" in close
    assert f"{least:.6g}" in close


def test_bound_under_the_gravity_of_one_point_is_only_checked(infoset: Command) -> None:
    peak = found(infoset, "asteroid-tour")["peak_control_m_s2"]
    err = infoset.refused("multipoint", "asteroid-tour", "--set", "max_control_m_s2=0.0001")
    assert (
        f"reaches {peak:.6g} m/s^2, {peak / 0.0001 - 1.0:.2%} over the bound of 0.0001 m/s^2" in err
    )
    assert "the bound is checked but not imposed" in err
    assert (
        infoset("multipoint", "asteroid-tour", "--set", f"max_control_m_s2={peak * 1.0001}", "-q")[
            0
        ]
        == 0
    )


def test_stays_that_fit_no_order(infoset: Command) -> None:
    stays = [
        f"target.{i}.{key}" for i in range(1, 6) for key in ("meet=rendezvous", "dwell_s=4000")
    ]
    options = [part for setting in (*stays, "times.latest_s=99000") for part in ("--set", setting)]
    assert "no order fits" in infoset.refused(
        "multipoint", "service-5", *options, "--order", "best", "--times", "given"
    )
