"""What `infoset pursuit` found, as JSON."""

from __future__ import annotations

from dataclasses import dataclass

from experiments.common.display_units import M_PER_KM
from experiments.common.output import library_version
from experiments.pursuit.file import PursuitProblem
from rendezvous.pursuit_evasion import (
    Capture,
    CaptureMap,
    Certificate,
    Ended,
    Flight,
    PlayerEnd,
    PointStatus,
    Solution,
    capture_quantiles_s,
)


@dataclass(frozen=True)
class Feedback:
    """Flights with feedback, and how they were asked for.

    Parameters
    ----------
    policy : str
        The evader's, or the file of its script.
    replan_s, delay_s : float
    position_noise_m, velocity_noise_m_s : float
    seed : int
    flights : tuple of Flight
    """

    policy: str
    replan_s: float
    delay_s: float
    position_noise_m: float
    velocity_noise_m_s: float
    seed: int
    flights: tuple[Flight, ...]


def counted(found: CaptureMap) -> str:
    """Return how many points of a map came out how, the words of a terminal and of a figure.

    Parameters
    ----------
    found : CaptureMap

    Returns
    -------
    str
    """
    return ", ".join(f"{found.count(status)} {status.value}" for status in PointStatus if found.count(status))


def report_json(
    problem: PursuitProblem,
    solution: Solution,
    certificate: Certificate | None,
    feedback: Feedback | None,
    elapsed_s: float,
) -> dict[str, object]:
    """Return what was found as it is written.

    Parameters
    ----------
    problem : PursuitProblem
    solution : Solution
    certificate : Certificate or None
        Where there is a capture.
    feedback : Feedback or None
        Where flights were asked for.
    elapsed_s : float

    Returns
    -------
    dict
    """
    capture = solution.capture
    return {
        "version": library_version(),
        "problem": problem.name,
        "problem_hash": problem.hash,
        **({"warnings": problem.warnings()} if problem.warnings() else {}),
        "elapsed_s": elapsed_s,
        "verdict": solution.verdict.value,
        **_captured(capture),
        "route": solution.route.value,
        "looked_at_s": solution.looked_at_s,
        "propellant_exhausted_by": solution.exhausted,
        "fallback_capture_time_s": None if solution.fallback is None else solution.fallback.time_s,
        "fallback_route": None if solution.fallback_route is None else solution.fallback_route.value,
        "units": {"length_km": solution.units.length_m / M_PER_KM, "time_s": solution.units.time_s},
        "certificate": None if certificate is None else _certified(certificate),
        "distance_curve": {
            "duration_s": solution.curve.duration_s.tolist(),
            "distance_km": (solution.curve.distance_m / M_PER_KM).tolist(),
            "least_curvature": solution.curve.least_curvature.tolist(),
        },
        **({"feedback": _flown(feedback)} if feedback is not None else {}),
    }


def _captured(capture: Capture | None) -> dict[str, object]:
    if capture is None:
        keys = ("capture_time_s", "capture_position_km", "direction", "pursuer", "evader")
        return dict.fromkeys((*keys, "closing_speed_km_s", "curvature"))
    return {
        "capture_time_s": capture.time_s,
        "capture_position_km": (capture.position_m / M_PER_KM).tolist(),
        "direction": capture.direction.tolist(),
        "pursuer": _player(capture.pursuer),
        "evader": _player(capture.evader),
        "closing_speed_km_s": capture.closing_speed_m_s / M_PER_KM,
        "curvature": capture.curvature.tolist(),
    }


def _player(end: PlayerEnd) -> dict[str, object]:
    return {
        "propellant_kg": end.propellant_kg,
        "final_position_km": (end.position_m / M_PER_KM).tolist(),
        "final_velocity_km_s": (end.velocity_m_s / M_PER_KM).tolist(),
        "costate0": end.costate_at_start.tolist(),
    }


def _certified(certificate: Certificate) -> dict[str, object]:
    return {
        "saddle_point": certificate.claims_saddle_point,
        "failures": list(certificate.failures),
        "residual": certificate.residual,
        "hamiltonian_drift": certificate.hamiltonian_drift,
        "second_integrator_gap_m": certificate.integrator_gap_m,
        "closing_speed_km_s": certificate.closing_speed_m_s / M_PER_KM,
        "least_curvature": certificate.least_curvature,
        "no_conjugate_point": certificate.no_conjugate_point,
        "no_earlier_capture": certificate.no_earlier_capture,
        "least_distance_from_centre_km": certificate.least_distance_m / M_PER_KM,
        "above_the_planet": certificate.above_the_planet,
        "pursuer_alone_s": certificate.pursuer_alone_s,
        "evader_deviations": [
            {"policy": each.name, "capture_time_s": each.capture_s, "conclusive": each.conclusive}
            for each in certificate.evader_deviations
        ],
        "directions_found": certificate.directions_found,
        "directions_tried": certificate.directions_tried,
        "greatest_excess_m": certificate.greatest_excess_m,
    }


def _flown(feedback: Feedback) -> dict[str, object]:
    quantiles = capture_quantiles_s(feedback.flights)
    return {
        "policy": feedback.policy,
        "replan_s": feedback.replan_s,
        "delay_s": feedback.delay_s,
        "position_noise_m": feedback.position_noise_m,
        "velocity_noise_m_s": feedback.velocity_noise_m_s,
        "seed": feedback.seed,
        "runs": len(feedback.flights),
        "captured": sum(flight.ended is Ended.CAPTURED for flight in feedback.flights),
        "capture_time_quantiles_s": dict(zip(("least", "10%", "50%", "90%", "greatest"), quantiles, strict=False)),
        "flights": [
            {
                "ended": flight.ended.value,
                "time_s": flight.time_s,
                "distance_m": flight.distance_m,
                "last_predicted_capture_s": float(flight.predicted_s[-1]),
            }
            for flight in feedback.flights
        ],
    }
