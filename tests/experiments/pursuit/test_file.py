from __future__ import annotations

import pytest

from experiments.common.errors import InputError
from experiments.common.toml_file import read_tables
from experiments.pursuit.file import FORM, PursuitProblem, load_pursuit, parameter_names
from rendezvous.pursuit_evasion import Game

BUILT_IN = ["geo-pursuit", "leo-pursuit"]


def read_problem(text: str, source: str) -> PursuitProblem:
    return PursuitProblem(read_tables(FORM, text, source), source)


@pytest.fixture(scope="module")
def text() -> str:
    return load_pursuit("geo-pursuit").toml


def complaint(text: str) -> str:
    with pytest.raises(InputError) as caught:
        read_problem(text, "mine.toml")
    return str(caught.value)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_problems_read_back_as_they_are_written(name: str) -> None:
    problem = load_pursuit(name)
    again = read_problem(problem.toml, "again")
    assert again.tables == problem.tables
    assert again.hash == problem.hash
    assert list(problem.warnings()) == []
    assert isinstance(problem.game(), Game)


def test_the_slides_case_is_what_the_slides_say() -> None:
    game = load_pursuit("geo-pursuit").game()
    assert (game.pursuer.thrust_n, game.evader.thrust_n) == (20.0, 10.0)
    assert (game.pursuer.mass_kg, game.pursuer.specific_impulse_s) == (2000.0, 350.0)
    assert game.distance_m == pytest.approx(6621.8e3, rel=1e-5)


def test_values_can_be_set_and_are_checked_as_in_a_file() -> None:
    problem = load_pursuit("geo-pursuit")
    changed = load_pursuit("geo-pursuit", ["evader.thrust_N=5", "capture_radius_km = 1e1"])
    assert changed.game().evader.thrust_n == 5.0
    assert changed.game().capture_radius_m == 10e3
    assert changed.hash != problem.hash
    with pytest.raises(InputError, match=r"did you mean evader\.thrust_N\?"):
        load_pursuit("geo-pursuit", ["evader.thrst_N=5"])
    with pytest.raises(InputError, match="must be a number"):
        load_pursuit("geo-pursuit", ["evader.mass_kg=heavy"])
    with pytest.raises(InputError, match=r"evader\.mass_kg: must be a finite number"):
        load_pursuit("geo-pursuit", ["evader.mass_kg=inf"])
    with pytest.raises(InputError, match=r"dry_mass_kg: must be below pursuer\.mass_kg"):
        load_pursuit("geo-pursuit", ["pursuer.mass_kg=10"])


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("eccentricity = 0.00016", "eccentricity = 1.2", ["evader.eccentricity", "hyperbola"]),
        ("semi_major_axis_km = 42166.0", "semi_major_axis_km = -42166.0", ["pursuer.semi_major_axis_km", "hyperbola"]),
        ("semi_major_axis_km = 42166.0", "semi_major_axis_km = nan", ["pursuer.semi_major_axis_km", "finite number"]),
        ("eccentricity = 0.00013", "eccentricity = 1.0", ["pursuer.eccentricity", "fall along a line"]),
        ("eccentricity = 0.00013", "eccentricity = 0.9", ["meets the planet", "4216.6 km"]),
        ("semi_major_axis_km = 42166.0", "semi_major_axis_km = 42.166", ["meets the planet", "kilometres"]),
        ("mass_kg = 2000.0", "mass_kg = 0", ["mass_kg", "greater than 0"]),
        ("dry_mass_kg = 1000.0", "dry_mass_kg = 2000.0", ["dry_mass_kg", "must be below"]),
        ("thrust_N = 20.0", "thrust_N = 0.0", ["pursuer.thrust_N", "needs thrust"]),
        ("thrust_N = 10.0", "thrust_N = -1.0", ["evader.thrust_N", "at least 0"]),
        ("specific_impulse_s = 350.0", "specific_impulse_s = 0", ["specific_impulse_s", "greater than 0"]),
        ("capture_radius_km = 0.0", "capture_radius_km = 7000", ["capture_radius_km", "distance at the start"]),
        ("capture_radius_km", "j2 = 0.001\ncapture_radius_km", ["equatorial_radius_km", "j2 refers to it"]),
        ("inclination_deg = 1.565\n", "", ["pursuer.inclination_deg", "is missing"]),
        ("[pursuer]\n", "[pursuer]\nposition_km = [1.0, 2.0, 3.0]\n", ["is given together with", "give either"]),
        ("gravitational_parameter_km3_s2 = 398600.4418", "", ["gravitational_parameter_km3_s2", "is missing"]),
        ("thrust_N = 20.0", "thrust_kN = 20.0", ["did you mean thrust_N"]),
        ('kind = "pursuit-evasion"', 'kind = "pursuit"', ['must be "pursuit-evasion"']),
        ("mass_kg = 2000.0", "mass_kg = nan", ["mass_kg", "finite"]),
    ],
)
def test_what_is_wrong_is_said_with_its_key_and_a_remedy(old: str, new: str, parts: list[str], text: str) -> None:
    assert old in text
    said = complaint(text.replace(old, new, 1))
    assert "mine.toml" in said
    for part in parts:
        assert part in said


def with_state(text: str, position: str, velocity: str) -> str:
    """The slides' case with the evader given by a state."""
    before, after = text.split("[evader]\n")
    kept = [line for line in after.splitlines() if line.split(" = ")[0].endswith(("mass_kg", "thrust_N", "impulse_s"))]
    return "\n".join([f"{before}[evader]", f"position_km = {position}", f"velocity_km_s = {velocity}", *kept, ""])


def test_a_player_may_be_given_by_a_state(text: str) -> None:
    game = read_problem(with_state(text, "[42000.0, 100.0, 0.0]", "[0.0, 3.08, 0.01]"), "mine").game()
    assert game.evader.position_m == (42000e3, 100e3, 0.0)
    assert game.evader.velocity_m_s == (0.0, 3080.0, 10.0)


@pytest.mark.parametrize(
    ("position", "velocity", "part"),
    [
        ("[42000.0, 0.0, 0.0]", "[0.0, 9.0, 0.0]", "hyperbola"),
        ("[42000.0, 0.0, 0.0]", "[1.0, 0.0, 0.0]", "fall along a line"),
        ("[5000.0, 0.0, 0.0]", "[0.0, 8.0, 0.0]", "meets the planet"),
        ("[0.0, 0.0, 0.0]", "[0.0, 8.0, 0.0]", "centre of the planet"),
        ("[42000.0, 0.0]", "[0.0, 3.0, 0.0]", "array of 3 numbers"),
    ],
)
def test_states_that_are_no_start(position: str, velocity: str, part: str, text: str) -> None:
    assert part in complaint(with_state(text, position, velocity))


def test_the_same_position_is_no_game(text: str) -> None:
    before, after = text.split("[evader]\n")
    start = before.split("[pursuer]\n")[1].split("mass_kg")[0]
    rest = "mass_kg" + after.split("mass_kg", 1)[1]
    said = complaint(f"{before}[evader]\n{start}{rest}")
    assert "where the pursuer is" in said


def test_units_mixed_up_are_warned_of(text: str) -> None:
    small = text.replace("planet_radius_km = 6378.137", "planet_radius_km = 0.1").replace("= 42166.0", "= 42.166")
    assert any("less than 100 km" in each for each in read_problem(small, "mine").warnings())
    metres = text.replace("= 42166.0", "= 42166000.0")
    assert "the orbit is 6611 times as large as the planet; at most 1000 times make sense" in complaint(metres)
    strong = text.replace("398600.4418", "398600441800000.0")
    assert any("is it in m^3/s^2?" in each for each in read_problem(strong, "mine").warnings())


def test_all_problems_are_told_at_once(text: str) -> None:
    said = complaint(text.replace("mass_kg = 2000.0", "mass_kg = 0").replace("thrust_N = 20.0", "thrust_N = 0"))
    assert "mine.toml has 3 problems" in said


def test_what_maps_vary(text: str) -> None:
    problem = PursuitProblem(read_problem(text, "mine").tables, "mine")
    assert "phase_deg" in parameter_names()
    assert problem.game({"thrust_ratio": 0.9}).evader.thrust_n == pytest.approx(18.0)
    assert problem.game({"mass_ratio": 0.75}).evader.mass_kg == 1500.0
    assert problem.game({"evader.mass_kg": 1800.0}).evader.mass_kg == 1800.0
    assert problem.game({"capture_radius_km": 5.0}).capture_radius_m == 5e3
    # The evader of the slides is 9 degrees behind the pursuer: 79 + 309 against 47 + 350.
    same = problem.game({"phase_deg": -9.0}).evader
    assert same.position_m == pytest.approx(problem.game().evader.position_m, rel=1e-12)
    with pytest.raises(ValueError, match="mass must be positive"):
        problem.game({"mass_ratio": 0.0})
    with pytest.raises(InputError, match="orbital elements"):
        read_problem(with_state(text, "[42000.0, 100.0, 0.0]", "[0.0, 3.08, 0.01]"), "mine").game({"phase_deg": 1.0})
