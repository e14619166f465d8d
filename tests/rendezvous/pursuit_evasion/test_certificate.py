from __future__ import annotations

from dataclasses import replace

import pytest

from infoset.rendezvous.pursuit_evasion import CaptureSolution, PathError, Policy, certify, solve
from infoset.rendezvous.pursuit_evasion.game import scaled_craft
from infoset.rendezvous.pursuit_evasion.paths import steered_path

from .conftest import MakeGame
from .published import CASES, Case


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.thrust_n:g}N")
def test_every_check_of_the_slides_cases_holds(case: Case, slides: MakeGame) -> None:
    solution = solve(slides(case.thrust_n))
    certificate = certify(solution)
    assert certificate.failures == ()
    assert certificate.claims_saddle_point
    assert certificate.residual < 1e-10
    assert certificate.hamiltonian_drift < 1e-11
    assert certificate.integrator_gap_m < 0.1
    assert certificate.pursuer_alone_s == pytest.approx(case.capture_s, abs=1e-4)
    assert len(certificate.evader_deviations) == (len(Policy) if case.thrust_n else 0)
    for deviation in certificate.evader_deviations:
        assert deviation.conclusive
        assert deviation.capture_s is not None
        assert deviation.capture_s < case.capture_s


def test_oblateness_passes_the_second_integrator(low: MakeGame) -> None:
    solution = solve(low())
    round_planet = solve(low(j2=0.0))
    certificate = certify(solution)
    assert certificate.failures == ()
    # It flies forward, with J2 as textbooks write it and the costates by a complex step of that.
    assert certificate.integrator_gap_m < 0.01
    assert solution.capture is not None
    assert round_planet.capture is not None
    assert 1.0 < abs(solution.capture.time_s - round_planet.capture.time_s) < 60.0


def test_an_evader_that_coasts_instead_is_captured_as_one_without_thrust(
    solved: CaptureSolution,
) -> None:
    coast = next(each for each in certify(solved).evader_deviations if each.name == "coast")
    assert solved.capture is not None
    assert coast.capture_s is not None
    assert coast.capture_s == pytest.approx(34287.714264, abs=1e-5)
    assert coast.capture_s - solved.capture.time_s == pytest.approx(-11055.906, abs=1e-3)
    prograde = next(each for each in certify(solved).evader_deviations if each.name == "prograde")
    assert prograde.capture_s is not None
    assert 34e3 < prograde.capture_s < 35e3


def test_scan_finds_the_maximum_at_the_solution(solved: CaptureSolution) -> None:
    certificate = certify(solved, all_directions=True)
    assert certificate.claims_saddle_point
    assert certificate.directions_tried == 120
    assert certificate.directions_found > 50
    assert certificate.max_excess_m is not None
    assert certificate.max_excess_m < 1.0


@pytest.mark.parametrize(
    ("found", "is_claimed"), [(120, True), (73, True), (60, True), (59, False), (1, False)]
)
def test_saddle_point_is_not_claimed_if_more_than_half_of_the_directions_are_undecided(
    found: int, is_claimed: bool, solved: CaptureSolution
) -> None:
    certificate = replace(certify(solved), directions_tried=120, directions_found=found)
    assert certificate.failures == ()
    assert certificate.claims_saddle_point == is_claimed


def test_earlier_capture_by_the_pursuer_alone_is_reported(slides: MakeGame) -> None:
    # Close to equal thrusts l(T) stays above zero long after the planned path of the evader can be
    # met.
    certificate = certify(solve(slides(18.0, anomaly_deg=324.0)))
    assert not certificate.claims_saddle_point
    assert certificate.pursuer_alone_s is not None
    assert certificate.pursuer_alone_s < certificate.capture_s
    assert any("the pursuer alone captures" in each for each in certificate.failures)


def test_inexact_capture_is_reported(solved: CaptureSolution) -> None:
    assert solved.capture is not None
    node = solved.capture.extremal
    off = replace(node, pursuer=node.pursuer + 1e-5, duration=node.duration * 1.001)
    wrong = replace(solved, capture=replace(solved.capture, extremal=off, residual=1e-5))
    failures = certify(wrong).failures
    assert any("residual" in each for each in failures)
    assert any("second integrator" in each for each in failures)


def test_path_that_turns_too_fast_is_reported(
    solved: CaptureSolution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("infoset.rendezvous.pursuit_evasion.paths._MAX_RATES", 100)
    evader = scaled_craft(solved.game.evader, solved.game.gravity, solved.units)
    with pytest.raises(PathError, match="turns too fast"):
        steered_path(evader, Policy.PROGRADE.direction, 3.4)
    failures = certify(solved).failures
    assert "the answer to coast could not be followed" in failures
