from __future__ import annotations

import re

import pytest

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import load_problem, read_text
from infoset.experiments.pursuit.file import PursuitProblem
from infoset.experiments.pursuit.map import game_at
from tests.built_in import problem_text

TEXT = problem_text("geo-pursuit")
STATE = "[evader.state]\nposition_km = {}\nvelocity_km_s = {}\n"


def with_state(position: str = "[42000.0, 100.0, 0.0]", velocity: str = "[0.0, 3.08, 0.01]") -> str:
    """The slides' case with the evader given by a state."""
    return TEXT.partition("[evader.orbit]")[0] + STATE.format(position, velocity)


def test_problem_file_has_the_values_of_the_slides() -> None:
    game = load_problem("geo-pursuit").game
    assert (game.pursuer.thrust_n, game.evader.thrust_n) == (20.0, 10.0)
    assert (game.pursuer.mass_kg, game.pursuer.specific_impulse_s) == (2000.0, 350.0)
    assert game.distance_m == pytest.approx(6621.8e3, rel=1e-5)


def test_a_player_may_be_given_by_a_state() -> None:
    game = read_text(PursuitProblem, with_state(), "mine").game
    assert game.evader.position_m == (42000e3, 100e3, 0.0)
    assert game.evader.velocity_m_s == (0.0, 3080.0, 10.0)


ORBIT = TEXT.partition("[pursuer.orbit]")[2].partition("\n\n")[0]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            TEXT.replace("= 0.00013", "= 0.9"),
            "pursuer: the orbit meets the planet: its perigee is 4216.6 km",
        ),
        (
            TEXT + STATE.format("[1, 0, 0]", "[0, 1, 0]"),
            "evader: orbit: give either the table orbit or the table state",
        ),
        (
            TEXT.replace(TEXT.partition("[evader.orbit]")[2], ORBIT),
            "pursuer and evader are at the same position",
        ),
        (
            TEXT.replace("capture_radius_km = 0.0", "capture_radius_km = 7000"),
            "the evader is within the capture radius",
        ),
        (
            TEXT.replace("[pursuer]", "j2 = 0.001\n[pursuer]"),
            "gravity: J2 needs the equatorial radius",
        ),
        (
            with_state("[42000.0, 0.0, 0.0]", "[0.0, 9.0, 0.0]"),
            "evader: the orbit is a parabola or a hyperbola",
        ),
    ],
)
def test_file_without_a_possible_game_is_refused(text: str, line: str) -> None:
    with pytest.raises(InputError, match=rf"^mine\.toml: {re.escape(line)}"):
        read_text(PursuitProblem, text, "mine.toml")


def test_map_changes_the_parameters_of_its_axes() -> None:
    problem = load_problem("geo-pursuit")
    assert game_at(problem, {"thrust_ratio": 0.9}).evader.thrust_n == pytest.approx(18.0)
    assert game_at(problem, {"evader.mass_kg": 1800.0}).evader.mass_kg == 1800.0
    assert game_at(problem, {"capture_radius_km": 5.0}).capture_radius_m == 5e3
    assert game_at(problem, {"pursuer.thrust_N": 8.0, "thrust_ratio": 0.5}).evader.thrust_n == 4.0
    # The evader of the slides is 9 degrees behind the pursuer: 79 + 309 against 47 + 350.
    same = game_at(problem, {"phase_deg": -9.0}).evader
    assert same.position_m == pytest.approx(problem.game.evader.position_m, rel=1e-12)
    with pytest.raises(InputError, match="dry_mass_kg: must be less than mass_kg"):
        game_at(problem, {"evader.mass_kg": 900.0})
