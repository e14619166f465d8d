"""Checks that a capture is a saddle point, as independent as possible of the solution's method.

The Hamiltonian is the one of Wang's slides, "Optimal control": H_P + H_E, constant, and one in
their scale. The other checks are not from the slides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._branch import MAX_WORK, Ending, follow
from infoset.rendezvous.pursuit_evasion._pair import (
    MAX_RESIDUAL,
    ExtremalCraft,
    KnownPath,
    Node,
    Pair,
    Side,
)
from infoset.rendezvous.pursuit_evasion._scan import greater, scan
from infoset.rendezvous.pursuit_evasion.game import scaled_game
from infoset.rendezvous.pursuit_evasion.paths import (
    ExtremalPath,
    PathError,
    extremal_paths,
    steered_path,
)
from infoset.rendezvous.pursuit_evasion.solution import CaptureSolution
from infoset.rendezvous.pursuit_evasion.steering import Policy

MAX_HAMILTONIAN_DRIFT = 1e-8
"""Maximum relative change of the Hamiltonian along the paths. It is constant except for the errors
of propagation; chosen: ten times `MAX_RESIDUAL`."""
MAX_INTEGRATOR_GAP = 1e-7
"""Maximum distance of the ends of the two integrators, in units of length: some 4 m in a
geostationary orbit. Chosen: the gaps of `leo-pursuit` and `geo-pursuit` are 1e-11 and 3e-12
(measured)."""
MAX_GAIN_S = 1e-2
"""Maximum difference of the capture times of a game and of a deviation, s, that is not a gain of
the player who deviates. Chosen: in `leo-pursuit` and `geo-pursuit` the pursuer alone captures
within 1e-9 s of the capture time, and deviations of the evader cost it minutes (measured)."""
MAX_EXCESS = 1e-6
"""Maximum distance beyond the capture radius, in units of length, that another direction may keep:
the gain for which the scan changes the branch (`_scan`). In `leo-pursuit` and `geo-pursuit` the
excess is 3e-11 and 1e-10 (measured)."""
MAX_UNDECIDED = 0.5
"""Maximum share of the directions of a scan that may be undecided if a saddle point is claimed: a
scan that decides less than half of them has not looked at most of the alternatives. `geo-pursuit`
leaves 47 of 120 undecided."""

_PANELS = 32
"""Number of panels of the integral of the Hamiltonian: one in half a revolution of the longest
game. Chosen: with 8 to 64 the drift of games of half a revolution is below 1e-12 (measured).
"""
_POINTS = 8
"""Points of the rule on each panel: its error is below the errors of propagation. With 4 to 16 the
drift of `leo-pursuit` is 5e-13 at most, and with 2 it is 1e-9 (measured)."""
_MAX_CHANGES = 3
"""Largest number of changes of branch in the response to a deviation; chosen: each takes
seconds.
"""
_BEYOND = 1.0 + 1e-6
"""Duration up to which responses to deviations are followed, in capture times of the game. It is
above 1 by more than rounding, so that a response that captures at the capture time is found."""
_SECOND_TOLERANCE = 1e-12
"""Tolerance of the second integrator, as small as LSODA allows."""
_MAX_WORK = 2.0 * MAX_WORK
"""Maximum work of the responses to all deviations together, in the unit of `MAX_WORK`. Chosen:
twice the work that a game may take."""


@dataclass(frozen=True)
class Deviation:
    """A deviation of one player by a policy, with the optimal response of the other.

    `capture_s` is None without a capture until the capture time of the game; `conclusive` is False
    if the best response could not be computed.
    """

    name: str
    capture_s: float | None
    conclusive: bool


@dataclass(frozen=True)
class Certificate:
    """The checks of a capture.

    Parameters
    ----------
    residual : float
        That of the capture: error of the start states and of r_E - r_P = R nu, nondimensional.
    hamiltonian_drift : float
        Maximum relative change of the Hamiltonian, scaled to one, along the paths.
    integrator_gap_m : float
        Distance of the ends from those of a second integrator, another method in forward time.
    closing_speed_m_s : float
        Speed at which the distance falls at the capture.
    min_curvature : float
        Minimum eigenvalue of the Hessian of h_P - h_E + R across nu, nondimensional; R is the
        capture radius.
    no_conjugate_point : bool
        Whether neither extremal has one.
    no_earlier_capture : bool
        Whether l was followed from the start of the game and stayed above the capture radius.
    min_distance_m : float
        Minimum distance of both paths from the planet's centre, at some 290 times of the game.
    pursuer_alone_s : float or None
        Earliest capture of the evader on its fixed optimal path, the capture time if there is no
        earlier one; None if it could not be computed.
    evader_deviations : tuple of Deviation
        Deviations of the evader, with the best responses of the pursuer: each must capture until
        the capture time.
    capture_s : float
        The capture time of the game.
    directions_found, directions_tried : int
        Number of directions with a solution, and number of directions tried; zero without a scan.
    max_excess_m : float or None
        Maximum distance beyond the capture radius that some direction keeps, at the capture time;
        None without a scan, or if it found no direction.
    unit_length_m : float
        The unit of length in which some limits of the checks are.
    """

    residual: float
    hamiltonian_drift: float
    integrator_gap_m: float
    closing_speed_m_s: float
    min_curvature: float
    no_conjugate_point: bool
    no_earlier_capture: bool
    min_distance_m: float
    above_the_planet: bool
    pursuer_alone_s: float | None
    evader_deviations: tuple[Deviation, ...]
    capture_s: float
    directions_found: int
    directions_tried: int
    max_excess_m: float | None
    unit_length_m: float

    @property
    def failures(self) -> tuple[str, ...]:
        """Return a phrase for each check that failed."""
        gap_m = self.integrator_gap_m
        checks = (
            (self.residual < MAX_RESIDUAL, f"the residual is {self.residual:.1e}"),
            (
                self.hamiltonian_drift < MAX_HAMILTONIAN_DRIFT,
                f"the Hamiltonian drifts by {self.hamiltonian_drift:.1e}",
            ),
            (
                gap_m < MAX_INTEGRATOR_GAP * self.unit_length_m,
                f"a second integrator ends {gap_m:.3g} m away",
            ),
            (self.closing_speed_m_s > 0.0, "the closing speed is not positive"),
            (self.min_curvature > 0.0, "a curvature is not positive"),
            (self.no_conjugate_point, "an extremal has a conjugate point"),
            (self.no_earlier_capture, "earlier captures are not excluded"),
            (self.above_the_planet, "a path goes through the planet"),
        )
        failures = [text for holds, text in checks if not holds]
        if self.pursuer_alone_s is None:
            failures.append("the pursuer's deviation could not be followed")
        elif self.pursuer_alone_s < self.capture_s - MAX_GAIN_S:
            failures.append(f"the pursuer alone captures at {self.pursuer_alone_s:.2f} s")
        for deviation in self.evader_deviations:
            if not deviation.conclusive:
                failures.append(f"the answer to {deviation.name} could not be followed")
            elif deviation.capture_s is None or deviation.capture_s > self.capture_s + MAX_GAIN_S:
                failures.append(f"the evader gains by {deviation.name}")
        if self.max_excess_m is not None and self.max_excess_m > MAX_EXCESS * self.unit_length_m:
            failures.append(f"another direction keeps the evader {self.max_excess_m:.3g} m away")
        return tuple(failures)

    @property
    def undecided(self) -> tuple[str, ...]:
        """Return a phrase for each check that was not made or is only partly conclusive.

        They limit the claim.
        """
        if not self.directions_tried:
            return ("the other directions at the capture were not compared",)
        undecided = self.directions_tried - self.directions_found
        if not undecided:
            return ()
        return (f"{undecided} of {self.directions_tried} directions were not decided",)

    @property
    def is_mostly_undecided(self) -> bool:
        """Whether the directions were scanned, and more than half of them were not decided."""
        undecided = self.directions_tried - self.directions_found
        return undecided > MAX_UNDECIDED * self.directions_tried

    @property
    def claims_saddle_point(self) -> bool:
        """Whether no check failed, and a scan, if made, decided at least half of the directions.

        `undecided` lists what the checks leave open.
        """
        return not self.failures and not self.is_mostly_undecided


def certify(solution: CaptureSolution, *, all_directions: bool = False) -> Certificate:
    """Check the capture of a `solution`.

    `all_directions` also scans all directions at the capture time. The scan looks for a direction
    that keeps the evader farther away. Cost: 0.3 s for one revolution, and at least 0.5 s more for
    the directions. All deviations together take at most twice the work limit of a game; in games of
    more than six revolutions the last ones may be inconclusive.

    Raises
    ------
    ValueError
        If there is no capture.
    """
    capture = solution.capture
    if capture is None:
        raise ValueError(f"there is no capture to certify: the verdict is {solution.verdict.value}")
    game = solution.game
    units = solution.units
    node = capture.extremal
    scaled = scaled_game(game, units)
    pursuer = scaled.pursuer
    evader = scaled.evader
    radius = scaled.radius
    paths = extremal_paths(pursuer, evader, node)
    drift, min_distance = _along(paths, node)

    # The pursuer deviates from a fixed evader.
    latest = node.duration * _BEYOND
    alone = _followed(pursuer, KnownPath(paths[1].state_at), radius, latest, _MAX_WORK)
    alone_s: float | None = None
    if alone.capture is not None:
        alone_s = alone.capture * units.time_s
    elif alone.conclusive:
        alone_s = node.duration * units.time_s

    # The evader deviates, and the pursuer responds.
    # One without thrust cannot.
    left = alone.work_left
    deviations: list[Deviation] = []
    for policy in Policy if evader.thrust > 0.0 else ():
        try:
            path = steered_path(evader, policy.direction, latest)
        except PathError:
            deviations.append(Deviation(policy.value, None, False))
            continue
        response = _followed(pursuer, KnownPath(path.state_at), radius, latest, left)
        left = response.work_left
        captured_s = None if response.capture is None else response.capture * units.time_s
        deviations.append(Deviation(policy.value, captured_s, response.conclusive))

    scanned = scan(scaled.pair, node) if all_directions else None
    max_excess_m: float | None = None
    if scanned is not None:
        peaks = [peak.distance for peak in scanned.maxima]
        excess = max([float(scanned.distance.max(initial=-np.inf)), *peaks]) - radius
        if np.isfinite(excess):
            max_excess_m = float(excess) * units.length_m

    # The last duration of the curve is the capture itself, to rounding.
    earlier_m = solution.curve.distance_m[solution.curve.duration_s < capture.time_s * (1.0 - 1e-9)]
    return Certificate(
        residual=capture.residual,
        hamiltonian_drift=drift,
        integrator_gap_m=_integrator_gap(pursuer, evader, node) * units.length_m,
        closing_speed_m_s=capture.closing_speed_m_s,
        min_curvature=float(node.curvature[0] + node.distance),
        no_conjugate_point=node.regular,
        no_earlier_capture=bool(len(earlier_m)) and bool((earlier_m > game.capture_radius_m).all()),
        min_distance_m=min_distance * units.length_m,
        above_the_planet=min_distance * units.length_m > game.gravity.planet_radius_m,
        pursuer_alone_s=alone_s,
        evader_deviations=tuple(deviations),
        capture_s=capture.time_s,
        directions_found=0 if scanned is None else len(scanned.nu),
        directions_tried=0 if scanned is None else scanned.tried,
        max_excess_m=max_excess_m,
        unit_length_m=units.length_m,
    )


class _Followed(NamedTuple):
    """End of a branch: the earliest capture, whether it reached an end, and the remaining work."""

    capture: float | None
    conclusive: bool
    work_left: float


def _followed(pursuer: Side, evader: Side, radius: float, latest: float, left: float) -> _Followed:
    """Follow the branch of two sides to its capture, or to the latest time.

    At a fold it changes to a branch that keeps the evader farther away, as in `solve`.
    """
    pair = Pair(pursuer, evader)
    first = pair.begin(latest, radius)
    if first is None:
        return _Followed(None, False, left)

    branch = follow(pair, first, radius, latest, left)
    left -= branch.work
    for _ in range(_MAX_CHANGES):
        better = greater(pair, branch.last) if branch.ending is Ending.FOLD else None
        if better is None:
            break
        branch = follow(pair, better, radius, latest, left)
        left -= branch.work
    if branch.ending is Ending.CAPTURE:
        return _Followed(branch.last.duration, True, left)
    return _Followed(None, branch.ending is Ending.TIME, left)


def _along(paths: tuple[ExtremalPath, ExtremalPath], node: Node) -> tuple[float, float]:
    """Return the drift of the Hamiltonians, and the minimum distance from the centre, both sampled.

    H_P and H_E are constant each. The drift is the larger one of their maximum deviations from the
    value at the end, divided by the closing speed: the sum of both is then one. The costate of the
    mass is minus the integral of |p_v| thrust / m^2 from a time to the end, by Gauss and Legendre's
    rule on panels.
    """
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.linspace(0.0, node.duration, _PANELS + 1)
    width = edges[1] - edges[0]
    inner = edges[:-1, None] + 0.5 * width * (1.0 + points)
    times = np.sort(np.concatenate([edges, inner.ravel()]))
    at_edges = np.searchsorted(times, edges)
    at_inner = np.searchsorted(times, inner.ravel())
    drift = 0.0
    minimum = np.inf
    for path in paths:
        y = path.sampled(times)
        craft = path.craft
        mass = craft.mass - craft.flow * times
        size = np.linalg.norm(y[:, 9:], axis=1)
        rates = (size * craft.thrust / mass**2)[at_inner].reshape(_PANELS, _POINTS)
        # The integral from each edge to the end.
        lost = np.append(np.cumsum((rates @ weights * 0.5 * width)[::-1])[::-1], 0.0)
        e = y[at_edges]
        gravity = np.array([_gravity(r, craft) for r in e[:, :3]])
        hamiltonian = (e[:, 6:9] * e[:, 3:6]).sum(axis=1) + (e[:, 9:] * gravity).sum(axis=1)
        hamiltonian += (craft.thrust * size / mass)[at_edges] + craft.flow * lost
        drift = max(drift, float(np.abs(hamiltonian - hamiltonian[-1]).max()) / node.closing)
        minimum = min(minimum, float(np.linalg.norm(y[:, :3], axis=1).min()))
    return drift, minimum


def _integrator_gap(pursuer: ExtremalCraft, evader: ExtremalCraft, node: Node) -> float:
    """Return the distance of a second integrator's ends from those in `node`, in units of length.

    LSODA integrates both craft forward, from their states and costates at the start. The result is
    the larger of the two distances.
    """
    gaps = []
    for craft, costate, end in zip(
        (pursuer, evader), node.costates, (node.pursuer, node.evader), strict=True
    ):
        forward = solve_ivp(
            _forward_rates,
            (0.0, node.duration),
            np.concatenate([craft.start, costate]),
            method="LSODA",
            rtol=_SECOND_TOLERANCE,
            atol=_SECOND_TOLERANCE,
            args=(craft,),
        )
        gaps.append(float(np.linalg.norm(forward.y[:3, -1] - end[:3])))
    return max(gaps)


def _forward_rates(time: float, y: Floats, craft: ExtremalCraft) -> Floats:
    """Return the rates of state and costate in time.

    Gravity's gradient along p_v is a complex step, not a formula: Im f(r + i h p) / h. It has no
    difference, in which digits would cancel, so that h can be 1e-30: its error is of the order h^2.
    """
    out = np.empty(12)
    p = y[9:]
    # p_v may be zero at the end: 1e-300 only avoids a division by zero.
    size = float(np.linalg.norm(p))
    out[:3] = y[3:6]
    push = craft.thrust / (craft.mass - craft.flow * time)
    out[3:6] = _gravity(y[:3], craft) + push * p / max(size, 1e-300)
    out[6:9] = -_gravity(y[:3] + 1e-30j * p, craft).imag / 1e-30
    out[9:] = -y[6:9]
    return out


def _gravity(r: Any, craft: ExtremalCraft) -> Any:
    """Return the acceleration of gravity at r, shape (3,), in Cartesian form.

    The formula is independent of `_extremal.derivatives`, and has no norm and no absolute value, so
    that a complex position gives the derivative. `oblateness` is mu J2 R^2 / 2, about the z axis.
    """
    q = (r * r).sum()
    cube = q * np.sqrt(q)
    if craft.oblateness == 0.0:
        return -craft.mu * r / cube
    ratio = 5.0 * r[2] * r[2] / q
    factors = np.array([1.0 - ratio, 1.0 - ratio, 3.0 - ratio])
    return -craft.mu * r / cube - 3.0 * craft.oblateness / (cube * q) * factors * r
