"""Numbers of the slides of Wang, after Shen and Casalino (2018): the orbital pursuit-evasion game."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments.common.display_units import M_PER_KM
from experiments.common.printed_numbers import Progress, Reproduction, read_paper
from experiments.pursuit.file import load_pursuit
from rendezvous.pursuit_evasion import Capture, Policy, Solution, certify, fly, solve
from sim.storage.codec import fingerprint

PAPER = "pursuit"
PROBLEM = "geo-pursuit"
_MU_M3_S2 = 398600.4418e9
_GEO_M = 42166e3
_EXHAUST_M_S = 350.0 * 9.80665
_THRUSTS_N = (0.0, 5.0, 10.0, 15.0)
_RADII_KM = (1.0, 100.0)
_POLICIES = (None, Policy.COAST, Policy.PROGRADE, Policy.NORMAL)
"""Of the evader; the first is the optimal one."""
_SHARES = (1.0, 0.1, 0.01)


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    problem = load_pursuit(PROBLEM)
    ours: dict[str, list[float | None]] = {}
    for done, thrust_n in enumerate(_THRUSTS_N, start=1):
        capture = solve(replace(problem, evader=replace(problem.evader, thrust_N=thrust_n)).game).capture
        ours[f"T_E = {thrust_n:g} N"] = _row(capture, ends=thrust_n == 10.0)
        progress(0.1 * done)
    for radius_km in _RADII_KM:
        capture = solve(replace(problem, capture_radius_m=radius_km * M_PER_KM).game).capture
        ours[f"capture radius {radius_km:g} km"] = [None if capture is None else capture.time_s]
    solution = solve(problem.game)
    ours["the evader coasts"] = [_deviation_s(solution)]
    progress(0.5)
    for policy in _POLICIES:
        ours[f"replanned, E {policy.value if policy else 'optimal'}"] = [_replanned_s(solution, policy)]
    progress(0.9)
    paper = read_paper(PAPER)
    numbers = paper.compare(ours)
    progress(1.0)
    return Reproduction(paper, ((problem.name, fingerprint(problem)),), numbers)


def _row(capture: Capture | None, *, ends: bool) -> list[float | None]:
    """Return times, propellants, speed and curvatures, and with `ends` the end of the game."""
    if capture is None:
        return [None] * (18 if ends else 6)
    pursuer, evader = capture.pursuer, capture.evader
    row = [capture.time_s, pursuer.propellant_kg, evader.propellant_kg, capture.closing_speed_m_s / M_PER_KM]
    if not ends:
        return [*row, *capture.curvature]
    velocities_km_s = np.concatenate([pursuer.velocity_m_s, evader.velocity_m_s]) / M_PER_KM
    return [*row, *capture.curvature, *capture.position_m / M_PER_KM, *capture.direction, *velocities_km_s]


def _deviation_s(solution: Solution) -> float | None:
    """Return how much earlier the evader is captured if it coasts."""
    if solution.capture is None:
        return None
    deviations = {deviation.name: deviation.capture_s for deviation in certify(solution).evader_deviations}
    coast_s = deviations[Policy.COAST.value]
    return None if coast_s is None else coast_s - solution.capture.time_s


def _replanned_s(solution: Solution, policy: Policy | None) -> float:
    """Return the capture time that the last plan predicts, with a plan every 600 s."""
    steering = policy.direction if policy else None
    return float(fly(solution.game, steering, replan_s=600.0, solution=solution).predicted_s[-1])
