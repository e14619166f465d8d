"""Numbers of the slides of Wang, after Shen and Casalino (2018): the orbital pursuit-evasion game."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from experiments.common.display_units import M_PER_KM
from experiments.common.printed_numbers import Progress, Reproduction, read_paper
from experiments.pursuit.file import load_pursuit
from rendezvous.linear_game import (
    Thruster,
    circular_orbit_capture,
    free_space_capture,
    mass_loss_capture,
)
from rendezvous.pursuit_evasion import Capture, Game, Gravity, Player, Policy, Solution, certify, fly, solve
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
    numbers = paper.compare(ours | _analytic())
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


def _analytic() -> dict[str, list[float | None]]:
    ahead, far = np.array([100e3, 0.0, 0.0]), np.array([1000e3, 500e3, -200e3])
    offset, drift = np.array([100e3, 50e3, -20e3]), np.array([20.0, -50.0, 10.0])
    pursuer, evader = Thruster(20.0, 2000.0, _EXHAUST_M_S), Thruster(10.0, 2000.0, _EXHAUST_M_S)
    rate = math.sqrt(_MU_M3_S2 / _GEO_M**3)
    about, speed = np.array([100e3, 1500e3, 200e3]), np.array([10.0, -20.0, 15.0])
    cases = {
        "free space, from rest": free_space_capture(ahead, np.zeros(3), 0.01, 0.005),
        "free space": free_space_capture(offset, drift, 0.01, 0.005),
        "loss of mass": mass_loss_capture(far, drift, pursuer, evader),
        "linear game about a circle": circular_orbit_capture(about, speed, 0.01, 0.005, rate),
    }
    ours = {name: [None if capture is None else capture.time_s] for name, capture in cases.items()}
    for share in _SHARES:
        small = circular_orbit_capture(share * about, share * speed, share * 0.01, share * 0.005, rate)
        capture = solve(_small_game(share, share * about, share * speed, rate)).capture
        ratio = None if capture is None or small is None else capture.time_s / small.time_s - 1.0
        ours[f"{share:g} of that game"] = [ratio]
    return ours


def _small_game(share: float, offset: np.ndarray, drift: np.ndarray, rate: float) -> Game:
    """Return a game with a share of the linear game's offset and thrust, in central gravity, with constant masses."""
    (x, y, z), (vx, vy, vz) = offset, drift
    angle, radius = y / _GEO_M, _GEO_M + x
    outward = np.array([math.cos(angle), math.sin(angle), 0.0])
    ahead = np.array([-math.sin(angle), math.cos(angle), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    position = radius * outward + z * up
    velocity = vx * outward + radius * (rate + vy / _GEO_M) * ahead + vz * up
    pursuer = Player((_GEO_M, 0.0, 0.0), (0.0, rate * _GEO_M, 0.0), 2000.0, 200.0, share * 20.0, math.inf)
    evader = Player(tuple(position), tuple(velocity), 2000.0, 200.0, share * 10.0, math.inf)
    return Game(Gravity(_MU_M3_S2, 6378137.0), pursuer, evader)
