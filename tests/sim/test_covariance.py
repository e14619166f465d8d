"""Normal starts from a covariance, within the dispersion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from infoset import StateBox
from infoset.experiments import load_scenario
from infoset.sim import simulate
from infoset.sim.covariance import Covariance
from infoset.sim.draws import draw
from infoset.sim.scenario import Scenario, corners

ROWS = (
    (1.0,),
    (0.3, 1.0),
    (0.0, -0.2, 1.0),
    (0.6, 0.0, 0.1, 1.0),
    (0.0, -0.5, 0.0, 0.2, 1.0),
    (0, 0, 0.4, 0, 0, 1.0),
)
SIGMA = np.array([800.0, 1200.0, 4000.0, 0.05, 0.08, 0.03])
GIVEN = Covariance((800.0, 1200.0, 4000.0), (0.05, 0.08, 0.03), ROWS)


def normal(sigmas: float, step_s: float = 7200.0) -> Scenario:
    dart = load_scenario("dart-2022", [f"step_s={step_s}", f"camera.period_s={step_s}"])
    middle = np.array([100.0, -200.0, 88_416_000.0, 0.0, 0.01, -6140.0])
    ends = zip(middle - sigmas * GIVEN.sigma, middle + sigmas * GIVEN.sigma, strict=True)
    box = StateBox(
        **dict(zip(("y_m", "z_m", "x_m", "vy_m_s", "vz_m_s", "vx_m_s"), ends, strict=True))
    )
    return replace(dart, dispersion=box, covariance=GIVEN)


def test_all_forms_give_one_covariance() -> None:
    full = np.tril(np.array([[*row, *[0.0] * (6 - len(row))] for row in ROWS]))
    full += np.tril(full, -1).T
    matrix = np.outer(SIGMA, SIGMA) * full
    whole = Covariance(matrix_m2=tuple(map(tuple, matrix.tolist())))
    lower = Covariance(
        matrix_m2=tuple(tuple(row[: index + 1]) for index, row in enumerate(matrix.tolist()))
    )
    for each in (GIVEN, whole, lower):
        np.testing.assert_allclose(each.matrix, matrix, rtol=1e-14)
        scaled = each.root / SIGMA[:, None]
        np.testing.assert_allclose(scaled @ scaled.T, full, atol=1e-15)


def test_an_exact_component_and_one_that_follows_from_another_are_kept() -> None:
    known = Covariance((2.0, 0.0), (3.0, 1.0), ((1,), (0, 1), (1, 0, 1), (0, 0, 0, 1)))
    np.testing.assert_allclose(known.root @ known.root.T, known.matrix, atol=1e-12)
    assert not known.root[1].any()
    np.testing.assert_array_equal(known.root[2], 1.5 * known.root[0])


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({}, "must have matrix_m2, or position_sigma_m and velocity_sigma_m_s"),
        ({"matrix_m2": ((1.0,),), "position_sigma_m": (1.0,)}, "must have matrix_m2, or"),
        (
            {"position_sigma_m": (1.0, 1.0), "velocity_sigma_m_s": (1.0,)},
            "position_sigma_m and velocity_sigma_m_s must have as many values: got 2 and 1",
        ),
        (
            {"position_sigma_m": (-1.0,), "velocity_sigma_m_s": (1.0,)},
            "position_sigma_m must be at least 0",
        ),
        ({"matrix_m2": ((1.0, 0.5), (0.4, 1.0))}, "must be symmetric"),
        (
            {"matrix_m2": ((1.0, 2.0), (2.0, 1.0))},
            "correlation of components 1 and 2 is 2, and must be from -1 to 1",
        ),
        (
            {"matrix_m2": ((1.0, 0.9, -0.9), (0.9, 1.0, 0.9), (-0.9, 0.9, 1.0))},
            "have a negative eigenvalue, -0.8: check",
        ),
        (
            {"matrix_m2": ((0.0, 1.0), (1.0, 4.0))},
            "variance of component 1 is 0, so that its covariance with component 2 must be 0",
        ),
        ({"matrix_m2": ((1.0,), (0.0, -1.0))}, "variances must not be negative"),
        ({"matrix_m2": ((1.0, 0.0), (0.0,))}, "square matrix or its lower triangle"),
        (
            {"position_sigma_m": (1.0,), "velocity_sigma_m_s": (1.0,), "correlations": ((1,),)},
            "must have 2 rows",
        ),
        (
            {
                "position_sigma_m": (1.0,),
                "velocity_sigma_m_s": (1.0,),
                "correlations": ((2,), (0, 1)),
            },
            "diagonal",
        ),
    ],
)
def test_invalid_covariance_is_refused(values: dict[str, object], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Covariance(**values)  # type: ignore[arg-type]


def test_starts_have_the_covariance_and_equal_the_starts_of_single_runs() -> None:
    wide = normal(5.0)
    runs = 4000
    drawn = draw(wide, range(runs), seed=4)
    starts = np.concatenate([drawn.position_m, drawn.velocity_m_s], axis=1)
    lower, upper = corners(wide.dispersion)
    scaled = (starts - 0.5 * (lower + upper)) / SIGMA
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=4.0 / np.sqrt(runs))
    correlation = GIVEN.correlation
    error = np.sqrt((1.0 + correlation**2) / runs)
    assert (np.abs(scaled.T @ scaled / runs - correlation) < 4.0 * error).all()
    alone = draw(wide, [17], seed=4)
    np.testing.assert_array_equal(
        np.concatenate([alone.position_m, alone.velocity_m_s], axis=1)[0], starts[17]
    )


def test_redrawn_share_is_the_probability_outside_the_box() -> None:
    narrow = normal(1.5)
    runs = 3000
    drawn = draw(narrow, range(runs), seed=0)
    lower, upper = corners(narrow.dispersion)
    starts = np.concatenate([drawn.position_m, drawn.velocity_m_s], axis=1)
    assert ((starts >= lower) & (starts <= upper)).all()
    ends = 1.5 * np.ones(6)
    inside = multivariate_normal(cov=GIVEN.correlation).cdf(ends, lower_limit=-ends)
    assert drawn.redraws is not None
    tries = runs + drawn.redraws.sum()
    assert abs(runs / tries - inside) < 4.0 * np.sqrt(inside * (1.0 - inside) / tries)


def test_results_have_the_redrawn_share() -> None:
    quick = normal(1.5, 600.0)
    results = simulate(quick, 20, seed=0)
    expected = draw(quick, range(20), 0).redraws
    assert expected is not None
    assert results.to_dict()["redraws"] == expected.tolist()
    assert results.redrawn_share == pytest.approx(expected.sum() / (20 + expected.sum()))
    assert "redraws" not in simulate(replace(quick, covariance=None), 1).to_dict()


def test_a_covariance_far_wider_than_the_dispersion_is_refused() -> None:
    with pytest.raises(ValueError, match="covariance: 0 % of its starts are within dispersion"):
        normal(0.05)
    with pytest.raises(ValueError, match="covariance must have 6 components: got 4"):
        replace(load_scenario("dart-2022"), covariance=Covariance((1.0, 1.0), (1.0, 1.0)))


def test_a_plane_has_four_components() -> None:
    plane = replace(
        load_scenario("asteroid-1997"), covariance=Covariance((300.0, 0.0), (0.0, 30.0))
    )
    drawn = draw(plane, range(3), seed=0)
    assert drawn.position_m[:, 1].tolist() == [5_801_300.0] * 3
    assert drawn.velocity_m_s[:, 0].tolist() == [0.0] * 3
    assert len({*drawn.position_m[:, 0], *drawn.velocity_m_s[:, 1]}) == 6
