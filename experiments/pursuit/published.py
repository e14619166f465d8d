"""Numbers of the slides of Wang, after Shen and Casalino (2018): the orbital pursuit-evasion game."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from experiments.common.display_units import M_PER_KM
from experiments.common.published_number import COMPUTED, Origin, Progress, PublishedNumber, Reference, Reproduction
from experiments.pursuit.file import load_pursuit
from rendezvous.linear_game import Thruster, circular_orbit_capture, free_space_capture, mass_loss_capture
from rendezvous.pursuit_evasion import Capture, Game, Gravity, Player, Policy, Solution, certify, fly, solve

PAPER = "pursuit"
TITLE = "slides of Wang, after Shen and Casalino (2018), pursuit and evasion in orbit"
PROBLEM = "geo-pursuit"
REMARKS = (
    "The slides print the input and a picture, but no numerical result. The numbers here are reference values from two "
    "independent integrators.",
    "c = 350 s is the specific impulse; the exhaust speed is 350 x 9.80665 m/s.",
    "The equation of lambda_r lacks the factor (lambda_v . r), that of lambda_m lacks k.",
)
_REFERENCE = Reference(PAPER, COMPUTED, Origin.OTHER)
_EXACT = Reference(PAPER, COMPUTED, Origin.EXACT)
_MU_M3_S2 = 398600.4418e9
_GEO_M = 42166e3
_EXHAUST_M_S = 350.0 * 9.80665
_TABLE = {
    0.0: ("34287.714264", "199.79278937", "0.0", "0.3935052532", "0.07119", "0.49448"),
    5.0: ("38475.674988", "224.19582623", "56.04895656", "0.3488455999", "0.06099", "0.56478"),
    10.0: ("45343.620266", "264.21499851", "132.10749926", "0.2891199953", "0.05030", "0.69579"),
    15.0: ("61490.673989", "358.30306979", "268.72730234", "0.1973907350", "0.04421", "1.09635"),
}
"""Numbers of `_NAMES`, by the thrust of the evader in N."""
_NAMES = ("t_f (s)", "propellant P (kg)", "propellant E (kg)", "closing (km/s)", "curvature 1", "curvature 2")
_END = {
    f"{name}, {axis}": text
    for name, texts in {
        "r_f (km)": ("-39420.497090", "-19052.538637", "604.130676"),
        "nu": ("0.250766441", "0.966273907", "0.058574134"),
        "v_P (km/s)": ("1.612976850", "-2.237162348", "-0.068126510"),
        "v_E (km/s)": ("1.436953246", "-2.493381998", "-0.023752323"),
    }.items()
    for axis, text in zip("xyz", texts, strict=True)
}
_RADII = {1.0: "45340.161530", 100.0: "44998.078864"}
_FEEDBACK = {"optimal": "45343.6", Policy.COAST: "34632.0", Policy.PROGRADE: "34947.7", Policy.NORMAL: "36473.4"}
_SHARES = {1.0: "-4.278e-3", 0.1: "-4.566e-4", 0.01: "-4.595e-5"}


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    problem = load_pursuit(PROBLEM)
    numbers: list[PublishedNumber] = []
    for done, (thrust_n, printed) in enumerate(_TABLE.items(), start=1):
        capture = solve(problem.game({"evader.thrust_N": thrust_n})).capture
        source = f"T_E = {thrust_n:g} N"
        numbers += _REFERENCE.numbers(source, dict(zip(_NAMES, printed, strict=True)), _row(capture))
        if thrust_n == 10.0:
            numbers += _REFERENCE.numbers(source, _END, _end(capture))
        progress(0.1 * done)
    for radius_km, text in _RADII.items():
        capture = solve(problem.game({"capture_radius_km": radius_km})).capture
        ours = None if capture is None else capture.time_s
        numbers.append(_REFERENCE.number(f"capture radius {radius_km:g} km", "t_f (s)", text, ours))
    solution = solve(problem.game())
    numbers.append(_deviation(solution))
    progress(0.5)
    numbers += _feedback(solution)
    progress(0.9)
    numbers += _analytic()
    progress(1.0)
    return Reproduction(PAPER, TITLE, ((problem.name, problem.hash),), tuple(numbers), REMARKS)


def _row(capture: Capture | None) -> Sequence[float | None]:
    if capture is None:
        return [None] * len(_NAMES)
    spent = capture.pursuer.propellant_kg, capture.evader.propellant_kg
    return [capture.time_s, *spent, capture.closing_speed_m_s / M_PER_KM, *capture.curvature]


def _end(capture: Capture | None) -> Sequence[float | None]:
    if capture is None:
        return [None] * len(_END)
    velocities = (capture.pursuer.velocity_m_s, capture.evader.velocity_m_s)
    position, velocities_km_s = capture.position_m / M_PER_KM, np.concatenate(velocities) / M_PER_KM
    return [*position, *capture.direction, *velocities_km_s]


def _deviation(solution: Solution) -> PublishedNumber:
    """Return how much earlier the evader is captured if it coasts."""
    ours = None
    if solution.capture is not None:
        deviations = {deviation.name: deviation.capture_s for deviation in certify(solution).evader_deviations}
        coast_s = deviations[Policy.COAST.value]
        ours = None if coast_s is None else coast_s - solution.capture.time_s
    return _REFERENCE.number("the evader coasts", "capture less t_f (s)", "-11055.906", ours)


def _feedback(solution: Solution) -> list[PublishedNumber]:
    """Return the capture times that the last plan predicts, with a plan every 600 s."""
    numbers = []
    for policy, text in _FEEDBACK.items():
        steering = policy.direction if isinstance(policy, Policy) else None
        predicted_s = fly(solution.game, steering, replan_s=600.0, solution=solution).predicted_s
        name = policy.value if isinstance(policy, Policy) else policy
        numbers.append(_REFERENCE.number(f"replanned, E {name}", "t_f (s)", text, float(predicted_s[-1])))
    return numbers


def _analytic() -> list[PublishedNumber]:
    ahead, far = np.array([100e3, 0.0, 0.0]), np.array([1000e3, 500e3, -200e3])
    offset, drift = np.array([100e3, 50e3, -20e3]), np.array([20.0, -50.0, 10.0])
    pursuer, evader = Thruster(20.0, 2000.0, _EXHAUST_M_S), Thruster(10.0, 2000.0, _EXHAUST_M_S)
    rate = math.sqrt(_MU_M3_S2 / _GEO_M**3)
    about, speed = np.array([100e3, 1500e3, 200e3]), np.array([10.0, -20.0, 15.0])
    linear = circular_orbit_capture(about, speed, 0.01, 0.005, rate)
    cases = (
        ("free space, from rest", "6324.5553203368", free_space_capture(ahead, np.zeros(3), 0.01, 0.005)),
        ("free space", "21773.0539755394", free_space_capture(offset, drift, 0.01, 0.005)),
        ("loss of mass", "25599.6258933", mass_loss_capture(far, drift, pursuer, evader)),
        ("linear game about a circle", "21366.29566606", linear),
    )
    numbers = [
        _EXACT.number(name, "t_f (s)", text, None if capture is None else capture.time_s)
        for name, text, capture in cases
    ]
    for share, text in _SHARES.items():
        small = circular_orbit_capture(share * about, share * speed, share * 0.01, share * 0.005, rate)
        capture = solve(_small_game(share, share * about, share * speed, rate)).capture
        ours = None if capture is None or small is None else capture.time_s / small.time_s - 1.0
        name = "t_f over the linear game's, less 1"
        numbers.append(_REFERENCE.number(f"{share:g} of that game", name, text, ours))
    return numbers


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
