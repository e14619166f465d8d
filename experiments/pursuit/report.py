"""Results of `infoset pursuit` and `infoset pursuit-map`, as JSON and as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.problem_command import trajectories_csv
from infoset.experiments.common.screen import Part, number, number_table
from infoset.experiments.common.units import M_PER_KM, S_PER_HOUR
from infoset.experiments.pursuit.file import PursuitProblem
from infoset.rendezvous.pursuit_evasion import (
    Capture,
    CaptureSolution,
    Certificate,
    CertificateVerdict,
    Ended,
    Observation,
    PlayerHistory,
    PursuitFlight,
    history,
    orbital_axes,
)

INERTIAL_AXES = "inertial, z along the planet's axis"


@dataclass(frozen=True)
class Feedback:
    """Simulations with feedback, and their settings; the evader follows `policy`."""

    policy: str
    replan_s: float
    observation: Observation
    seed: int
    flights: tuple[PursuitFlight, ...]


@dataclass(frozen=True)
class PursuitReport:
    """Results of one command; the certificate is None without a capture."""

    problem: PursuitProblem
    solution: CaptureSolution
    certificate: Certificate | None
    feedback: Feedback | None


def report_json(report: PursuitReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`.

    Keys are mostly names of fields of the solution, its parts, the certificate and the feedback:
    renaming a field renames a key. The extremal, nondimensional and only an initial guess, is left
    out.
    """
    solution = report.solution
    values: dict[str, object] = {
        "axes": INERTIAL_AXES,
        "units": solution.units,
        "verdict": solution.verdict,
        "branch_changes": solution.branch_changes,
        "looked_at_s": solution.looked_at_s,
        "exhausted": solution.exhausted,
        "capture": None,
        "certificate": None,
        "distance_curve": solution.curve,
        "feedback": None,
    }
    if solution.capture is not None:
        capture = dict(vars(solution.capture))
        del capture["extremal"]
        values["capture"] = capture
    if report.certificate is not None:
        values["certificate"] = {
            "saddle_point": report.certificate.claims_saddle_point,
            "failures": report.certificate.failures,
            "undecided": report.certificate.undecided,
            **vars(report.certificate),
        }
    if report.feedback is not None:
        flights = _flights_json(report.feedback.flights)
        values["feedback"] = {**vars(report.feedback), "flights": flights}
    return values


def _flights_json(flights: Sequence[PursuitFlight]) -> list[dict[str, object]]:
    return [
        {
            "ended": flight.ended,
            "time_s": flight.time_s,
            "distance_m": flight.distance_m,
            "last_predicted_s": flight.predicted_s[-1],
        }
        for flight in flights
    ]


def trajectories(report: PursuitReport) -> str:
    """Return both trajectories as CSV, without rows if there is no capture.

    The direction of thrust is zero without thrust.
    """
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
    """Return the angles of the thrust in the craft's orbital frame, rad, shape (n, 2).

    They are the angles in the plane and out of it.
    """
    axes = orbital_axes(player.position_m, player.velocity_m_s)
    radial, along, normal = np.einsum("nij,nj->ni", axes, player.thrust_direction).T
    in_plane = np.unwrap(np.arctan2(radial, along))
    return np.stack([in_plane, np.arcsin(np.clip(normal, -1.0, 1.0))], axis=1)


def report_lines(report: PursuitReport) -> Iterator[Part]:
    """Yield the verdict, the players, the certificate and the simulations, for the screen."""
    solution = report.solution
    yield f"{report.problem.name}: {verdict_text(solution)}"
    yield f"axes: {INERTIAL_AXES}"
    if solution.capture is not None:
        yield from _capture_lines(solution.capture, solution)
    if report.certificate is not None:
        yield from (f"  {line}" for line in _certificate_lines(report.certificate))
    if report.feedback is not None:
        yield from _feedback_lines(report.feedback)


def _capture_lines(capture: Capture, solution: CaptureSolution) -> Iterator[Part]:
    """Yield the vectors as columns of a table and the scalars as lines.

    A narrow screen does not break the columns.
    """
    pursuer = capture.pursuer
    evader = capture.evader
    table = number_table(
        "",
        "capture at\nkm",
        "direction\nto evader",
        "velocity of\npursuer, km/s",
        "velocity of\nevader, km/s",
    )
    for i, axis in enumerate("xyz"):
        velocities = (f"{player.velocity_m_s[i] / M_PER_KM:.9f}" for player in (pursuer, evader))
        table.add_row(
            axis,
            f"{capture.position_m[i] / M_PER_KM:.6f}",
            f"{capture.direction[i]:.9f}",
            *velocities,
        )
    yield table

    yield (
        f"propellant spent, kg: pursuer {pursuer.propellant_kg:.8f}, evader "
        f"{evader.propellant_kg:.8f}"
    )
    yield f"closing speed {capture.closing_speed_m_s / M_PER_KM:.10f} km/s"
    yield (
        "curvatures of the distance over the direction: "
        f"{' and '.join(f'{value:.4g}' for value in capture.curvature)} times "
        f"{solution.units.length_m / M_PER_KM:.6g} km (positive at a saddle point)"
    )
    yield f"changes to a branch that keeps the evader farther away: {solution.branch_changes}"


def verdict_text(solution: CaptureSolution) -> str:
    """Return the verdict of a game with its time."""
    if solution.capture is not None and solution.verdict is CertificateVerdict.CAPTURED:
        return (
            f"captured at {solution.capture.time_s:.6f} s "
            f"({solution.capture.time_s / S_PER_HOUR:.4f} h)"
        )

    looked_at_s = solution.looked_at_s
    # Below a second a decimal digit would say little.
    until = f"{looked_at_s:.1f} s" if looked_at_s >= 1.0 else f"{looked_at_s:.3g} s"
    if solution.verdict is CertificateVerdict.PROPELLANT_EXHAUSTED:
        return (
            f"propellant-exhausted: the {solution.exhausted} has no propellant after {until}; no "
            "capture before"
        )
    if solution.verdict is CertificateVerdict.ESCAPES:
        why = "the end of the time searched"
        if solution.exhausted:
            why = f"the {solution.exhausted} has no propellant"
        return f"escapes: no capture until {why}, {until}"
    if looked_at_s == 0.0:
        return (
            "branch-not-certified: no game could be followed, not even a short one; check the "
            "units of the values"
        )
    return (
        f"branch-not-certified: the extremals are a saddle up to a duration of {until}; no claim "
        "for longer ones"
    )


def _certificate_lines(certificate: Certificate) -> Iterator[str]:
    yield (
        f"residual {certificate.residual:.1e}, Hamiltonian constant to "
        f"{certificate.hamiltonian_drift:.1e}, difference of a second integrator "
        f"{certificate.integrator_gap_m:.2g} m"
    )
    confirmed = "confirmed" if certificate.no_earlier_capture else "not confirmed"
    yield (
        f"no earlier capture: {confirmed}; smallest distance from the planet's centre "
        f"{certificate.min_distance_m / M_PER_KM:.1f} km"
    )
    if certificate.pursuer_alone_s is not None:
        yield f"earliest capture if only the pursuer deviates: {certificate.pursuer_alone_s:.3f} s"
    answers = []
    for deviation in certificate.evader_deviations:
        time_s = deviation.capture_s
        time = "not known" if time_s is None else f"{time_s:.1f} s"
        answers.append(f"{deviation.name} {time}")
    if answers:
        yield f"captures if the evader deviates and the pursuer responds: {', '.join(answers)}"
    yield saddle_point(certificate)


def saddle_point(certificate: Certificate | None) -> str:
    """Return the claim of a certificate about the saddle point; empty without a certificate."""
    if certificate is None:
        return ""
    if not certificate.claims_saddle_point:
        reasons = certificate.failures
        if certificate.is_mostly_undecided:
            reasons = (*reasons, *certificate.undecided)
        return f"saddle point: not claimed: {'; '.join(reasons)}"
    if certificate.undecided:
        why = "add --certify"
        if certificate.directions_tried:
            why = "no farthest extremal was found for one craft or both"
        return f"saddle point: no check failed; {'; '.join(certificate.undecided)} ({why})"
    return "saddle point: all checks hold"


def _feedback_lines(feedback: Feedback) -> Iterator[str]:
    flights = feedback.flights
    heading = f"feedback, a plan every {feedback.replan_s:g} s, evader {feedback.policy}: "
    if len(flights) == 1:
        (flight,) = flights
        yield (
            f"{heading}{flight.ended.value} at {flight.time_s:.1f} s, distance "
            f"{flight.distance_m:.4g} m; last predicted capture {flight.predicted_s[-1]:.1f} s"
        )
        return

    captured = [each for each in flights if each.ended is Ended.CAPTURED]
    yield f"{heading}{len(captured)} of {len(flights)} captured"
    if captured:
        yield f"  capture time, s: {_distribution([flight.time_s for flight in captured])}"
    yield f"  distance at the end, m: {_distribution([flight.distance_m for flight in flights])}"


def _distribution(values: Sequence[float]) -> str:
    return (
        f"smallest {number(min(values))}, median {number(float(np.median(values)))}, largest "
        f"{number(max(values))}"
    )
