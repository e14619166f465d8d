"""Results of `infoset pursuit` and `infoset pursuit-map`, as JSON and as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.common.display_units import M_PER_KM, S_PER_HOUR
from experiments.common.problem_command import trajectories_csv
from experiments.common.screen import Part, number, number_table
from experiments.pursuit.file import PursuitProblem
from infoset.arrays import Floats
from rendezvous.pursuit_evasion import (
    Capture,
    Certificate,
    Ended,
    Flight,
    Observation,
    PlayerEnd,
    PlayerHistory,
    Solution,
    Verdict,
    history,
    orbital_axes,
)

INERTIAL_AXES = "inertial, z along the planet's axis"


@dataclass(frozen=True)
class Feedback:
    """Simulations with feedback, and their settings; `policy` is that of the evader, or the file of its script."""

    policy: str
    replan_s: float
    observation: Observation
    seed: int
    flights: tuple[Flight, ...]


@dataclass(frozen=True)
class Report:
    """Results of one command; the certificate is None without a capture."""

    problem: PursuitProblem
    solution: Solution
    certificate: Certificate | None
    feedback: Feedback | None


def report_json(report: Report) -> dict[str, object]:
    """Return the results for `experiments.common.output.to_json`."""
    solution, certificate = report.solution, report.certificate
    return {
        "verdict": solution.verdict,
        **_capture_json(solution.capture),
        "route": solution.route,
        "looked_at_s": solution.looked_at_s,
        "propellant_exhausted_by": solution.exhausted,
        "axes": INERTIAL_AXES,
        "units": {"length_km": solution.units.length_m / M_PER_KM, "time_s": solution.units.time_s},
        "certificate": None if certificate is None else _certificate_json(certificate),
        "distance_curve": {
            "duration_s": solution.curve.duration_s,
            "distance_km": solution.curve.distance_m / M_PER_KM,
            "min_curvature": solution.curve.min_curvature,
        },
        **({"feedback": _feedback_json(report.feedback)} if report.feedback is not None else {}),
    }


def _capture_json(capture: Capture | None) -> dict[str, object]:
    if capture is None:
        keys = ("capture_time_s", "capture_position_km", "direction", "pursuer", "evader")
        return dict.fromkeys((*keys, "closing_speed_km_s", "curvature"))
    return {
        "capture_time_s": capture.time_s,
        "capture_position_km": capture.position_m / M_PER_KM,
        "direction": capture.direction,
        "pursuer": _player_json(capture.pursuer),
        "evader": _player_json(capture.evader),
        "closing_speed_km_s": capture.closing_speed_m_s / M_PER_KM,
        "curvature": capture.curvature,
    }


def _player_json(end: PlayerEnd) -> dict[str, object]:
    return {
        "propellant_kg": end.propellant_kg,
        "final_position_km": end.position_m / M_PER_KM,
        "final_velocity_km_s": end.velocity_m_s / M_PER_KM,
        "costate0": end.costate_at_start,
    }


def _certificate_json(certificate: Certificate) -> dict[str, object]:
    return {
        "saddle_point": certificate.claims_saddle_point,
        "failures": certificate.failures,
        "undecided": certificate.undecided,
        "residual": certificate.residual,
        "hamiltonian_drift": certificate.hamiltonian_drift,
        "second_integrator_gap_m": certificate.integrator_gap_m,
        "closing_speed_km_s": certificate.closing_speed_m_s / M_PER_KM,
        "min_curvature": certificate.min_curvature,
        "no_conjugate_point": certificate.no_conjugate_point,
        "no_earlier_capture": certificate.no_earlier_capture,
        "min_distance_from_centre_km": certificate.min_distance_m / M_PER_KM,
        "above_the_planet": certificate.above_the_planet,
        "pursuer_alone_s": certificate.pursuer_alone_s,
        "evader_deviations": [
            {"policy": deviation.name, "capture_time_s": deviation.capture_s, "conclusive": deviation.conclusive}
            for deviation in certificate.evader_deviations
        ],
        "directions_found": certificate.directions_found,
        "directions_tried": certificate.directions_tried,
        "max_excess_m": certificate.max_excess_m,
    }


def _feedback_json(feedback: Feedback) -> dict[str, object]:
    return {
        "policy": feedback.policy,
        "replan_s": feedback.replan_s,
        "delay_s": feedback.observation.delay_s,
        "position_noise_m": feedback.observation.position_error_m,
        "velocity_noise_m_s": feedback.observation.velocity_error_m_s,
        "seed": feedback.seed,
        "flights": [
            {
                "ended": flight.ended,
                "time_s": flight.time_s,
                "distance_m": flight.distance_m,
                "last_predicted_capture_s": flight.predicted_s[-1],
            }
            for flight in feedback.flights
        ],
    }


def trajectories(report: Report) -> str:
    """Return both trajectories as CSV, no line without a capture; without thrust the direction of thrust is zero."""
    columns = ["mass_kg", *(f"thrust_direction_{axis}" for axis in "xyz")]
    if report.solution.capture is None:
        return trajectories_csv(["player"], [], columns)
    sampled = history(report.solution)
    tracks = []
    for name, player in (("pursuer", sampled.pursuer), ("evader", sampled.evader)):
        state = np.hstack([player.position_m, player.velocity_m_s])
        tracks.append(([name], [sampled.time_s, state, player.mass_kg, player.thrust_direction]))
    return trajectories_csv(["player"], tracks, columns)


def thrust_angles(player: PlayerHistory) -> Floats:
    """Return the angles of the thrust in the craft's orbital frame, in and out of plane, rad, shape (n, 2)."""
    u = np.einsum("nij,nj->ni", orbital_axes(player.position_m, player.velocity_m_s), player.thrust_direction)
    return np.stack([np.unwrap(np.arctan2(u[:, 0], u[:, 1])), np.arcsin(np.clip(u[:, 2], -1.0, 1.0))], axis=1)


def report_lines(report: Report) -> Iterator[Part]:
    """Yield the verdict, the players, the certificate and the simulations, for the screen."""
    solution = report.solution
    yield f"{report.problem.name}: {_verdict(solution)}"
    yield f"axes: {INERTIAL_AXES}"
    if solution.capture is not None:
        yield from _capture_parts(solution.capture, solution)
    if report.certificate is not None:
        yield from (f"  {line}" for line in _certificate_lines(report.certificate))
    if report.feedback is not None:
        yield from _feedback_lines(report.feedback)


def _capture_parts(capture: Capture, solution: Solution) -> Iterator[Part]:
    """Yield vectors as columns of their components, which a narrow screen does not break, and the scalars as lines."""
    table = number_table(
        "", "capture at\nkm", "direction\nto evader", "velocity of\npursuer, km/s", "velocity of\nevader, km/s"
    )
    vectors = (
        capture.position_m / M_PER_KM,
        capture.direction,
        capture.pursuer.velocity_m_s / M_PER_KM,
        capture.evader.velocity_m_s / M_PER_KM,
    )
    for axis, components in zip("xyz", zip(*vectors, strict=True), strict=True):
        table.add_row(axis, *(f"{value:.{digits}f}" for value, digits in zip(components, (6, 9, 9, 9), strict=True)))
    yield table
    curvatures = " and ".join(f"{value:.5f}" if value >= 1e-3 else f"{value:.3g}" for value in capture.curvature)
    spent = f"pursuer {capture.pursuer.propellant_kg:.8f}, evader {capture.evader.propellant_kg:.8f}"
    yield f"propellant spent, kg: {spent}"
    yield f"closing speed {capture.closing_speed_m_s / M_PER_KM:.10f} km/s"
    yield (
        f"curvatures of the distance over the direction: {curvatures} times "
        f"{solution.units.length_m / M_PER_KM:.6g} km (positive at a saddle point)"
    )
    yield f"method: {solution.route.value}"


def _verdict(solution: Solution) -> str:
    until = f"{solution.looked_at_s:.1f} s" if solution.looked_at_s >= 1.0 else f"{solution.looked_at_s:.3g} s"
    if solution.capture is not None and solution.verdict is Verdict.CAPTURED:
        return f"captured at {solution.capture.time_s:.6f} s ({solution.capture.time_s / S_PER_HOUR:.4f} h)"
    if solution.verdict is Verdict.PROPELLANT_EXHAUSTED:
        return f"propellant-exhausted: the {solution.exhausted} has no propellant after {until}; no capture before"
    if solution.verdict is Verdict.ESCAPES:
        why = f"the {solution.exhausted} has no propellant" if solution.exhausted else "the end of the time searched"
        return f"escapes: no capture until {why}, {until}"
    if solution.looked_at_s == 0.0:
        return "branch-not-certified: no game could be followed, not even a short one; check the units of the values"
    return f"branch-not-certified: the extremals are a saddle up to a duration of {until}; no claim for longer ones"


def _certificate_lines(certificate: Certificate) -> Iterator[str]:
    yield (
        f"residual {certificate.residual:.1e}, Hamiltonian constant to {certificate.hamiltonian_drift:.1e}, "
        f"difference of a second integrator {certificate.integrator_gap_m:.2g} m"
    )
    yield (
        f"no earlier capture: {'confirmed' if certificate.no_earlier_capture else 'not confirmed'}; smallest distance "
        f"from the planet's centre {certificate.min_distance_m / M_PER_KM:.1f} km"
    )
    if certificate.pursuer_alone_s is not None:
        yield f"earliest capture if only the pursuer deviates: {certificate.pursuer_alone_s:.3f} s"
    answers = [
        f"{deviation.name} {'not known' if deviation.capture_s is None else f'{deviation.capture_s:.1f} s'}"
        for deviation in certificate.evader_deviations
    ]
    if answers:
        yield f"captures if the evader deviates and the pursuer responds: {', '.join(answers)}"
    if certificate.directions_tried:
        excess = certificate.max_excess_m
        largest = "no other extremal" if excess is None else f"largest excess over the capture radius {excess:.2g} m"
        yield (
            f"directions: {certificate.directions_found} of {certificate.directions_tried} compared; {largest}, "
            f"tolerance {certificate.excess_tolerance_m:.2g} m"
        )
    yield saddle_point(certificate)


def saddle_point(certificate: Certificate | None) -> str:
    """Return what a certificate says of the saddle point; nothing without a certificate."""
    if certificate is None:
        return ""
    if certificate.failures:
        return f"saddle point: not claimed: {'; '.join(certificate.failures)}"
    if certificate.undecided:
        why = (
            "no farthest extremal was found for one craft or both" if certificate.directions_tried else "add --certify"
        )
        return f"saddle point: no check failed; {'; '.join(certificate.undecided)} ({why})"
    return "saddle point: all checks hold"


def _feedback_lines(feedback: Feedback) -> Iterator[str]:
    flights, captured = feedback.flights, [each for each in feedback.flights if each.ended is Ended.CAPTURED]
    heading = f"feedback, a plan every {feedback.replan_s:g} s, evader {feedback.policy}: "
    if len(flights) == 1:
        (flight,) = flights
        yield (
            f"{heading}{flight.ended.value} at {flight.time_s:.1f} s, distance {flight.distance_m:.4g} m; "
            f"last predicted capture {flight.predicted_s[-1]:.1f} s"
        )
        return
    yield f"{heading}{len(captured)} of {len(flights)} captured"
    if captured:
        yield f"  capture time, s: {_distribution([flight.time_s for flight in captured])}"
    yield f"  distance at the end, m: {_distribution([flight.distance_m for flight in flights])}"


def _distribution(values: Sequence[float]) -> str:
    return f"smallest {number(min(values))}, median {number(float(np.median(values)))}, largest {number(max(values))}"
