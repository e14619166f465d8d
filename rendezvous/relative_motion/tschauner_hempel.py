"""Motion about an elliptic orbit (Tschauner and Hempel)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.relative_motion.elliptic_orbit import EllipticOrbit
from infoset.rendezvous.relative_motion.linear_motion import even_breaks
from infoset.rendezvous.relative_motion.time_varying import CollocatedMotion, HeldSegment, LinearSystem, collocate

PANEL_RAD = 1.0
"""Intervals of sigma up to this one are collocated: over a short one the closed form of the transition loses digits,
because its large terms nearly cancel. It joins longer ones: products of panels lose digits from e = 0.5 on."""
MAX_ECCENTRICITY = 1.0 - 1e-6
"""A time has 16 digits of a revolution, and the motion at perigee takes the share (1 - e)^(3/2) of it."""


class _Place(NamedTuple):
    """A place on the orbit: rho = 1 + e cos nu, sin nu, cos nu, the mean anomaly, and d nu / d sigma."""

    rho: Floats
    sine: Floats
    cosine: Floats
    mean_rad: Floats
    turning: Floats


@dataclass(frozen=True)
class TschaunerHempel(CollocatedMotion):
    """Relative motion about an elliptic `orbit`, from e = 0 on.

    Tschauner and Hempel's variables are x = rho r and x' = dx / d nu with rho = 1 + e cos nu:

        x'' = 3 x / rho + 2 y',  y'' = -2 x',  z'' = -z.

    The independent variable is the intermediate anomaly sigma, tan(E / 2) = kappa tan(sigma / 2) with kappa^4 = (1 - e)
    / (1 + e), halfway between the eccentric and the true anomaly. The motion has poles near perigee in E, and near
    apogee in nu, at a distance of about (1 - e)^(1/2); those in sigma are at (1 - e)^(1/4). Panels up to a radian of
    sigma are collocated, and joined by the transition in closed form.

    Raises
    ------
    ValueError
        If the eccentricity is above 0.999999.

    References
    ----------
    Yamanaka and Ankersen, "New state transition matrix for relative motion on an arbitrary elliptical orbit", J. Guid.
    Control Dyn. 25 (2002) 60-66, whose x is y here, and whose z is -x.
    """

    orbit: EllipticOrbit

    def __post_init__(self) -> None:
        if self.orbit.eccentricity > MAX_ECCENTRICITY:
            raise ValueError(
                f"the eccentricity must be at most {MAX_ECCENTRICITY:g}, found {self.orbit.eccentricity!r}: the motion "
                "at perigee is too short a part of a revolution for the digits of a time"
            )

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""
        return self.orbit.dynamics(time_s)

    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> HeldSegment:
        """Transition, Gramian and the effect of a held control together; end >= start, except for the transition."""
        starts, ends = np.broadcast_arrays(np.asarray(start_s, dtype=np.float64), np.asarray(end_s, dtype=np.float64))
        first, last = (self._intermediate(self.orbit.eccentric_anomaly(times.ravel())) for times in (starts, ends))
        scaled = self._scaled_segment(first, last)

        from_scaled = self._from_scaled(last)
        transition = from_scaled @ scaled.transition @ self._to_scaled(first)
        gramian = from_scaled @ scaled.gramian @ np.swapaxes(from_scaled, -1, -2)
        held = from_scaled @ scaled.held
        return HeldSegment(*(part.reshape(*starts.shape, *part.shape[1:]) for part in (transition, gramian, held)))

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, inclusive, a radian of the eccentric anomaly apart at most.

        The motion has poles at cos E = 1 / e; panels are no longer than the distance to them.
        """
        first, last = (float(anomaly) for anomaly in self.orbit.eccentric_anomaly(np.array([start_s, end_s])))
        e = self.orbit.eccentricity
        widest_rad = 1.0 if e < 0.6 else min(1.0, float(np.arccosh(1.0 / e)))
        times = self.orbit.time_of_eccentric(even_breaks(first, last, (last - first) / widest_rad))
        times[0], times[-1] = start_s, end_s
        return np.maximum.accumulate(np.minimum(times, end_s))

    def _scaled_segment(self, first: Floats, last: Floats) -> HeldSegment:
        """Return the solution in scaled variables between n pairs of sigma."""
        if not len(first):
            return HeldSegment(np.empty((0, 6, 6)), np.empty((0, 6, 6)), np.empty((0, 6, 3)))
        counts = np.maximum(np.ceil(np.abs(last - first) / PANEL_RAD), 1.0).astype(int)
        begins = np.cumsum(counts) - counts
        owner = np.repeat(np.arange(len(first)), counts)
        number = np.arange(len(owner)) - begins[owner]
        lengths = ((last - first) / counts)[owner]
        ends = np.where(number == counts[owner] - 1, last[owner], first[owner] + lengths * (number + 1))
        starts = first[owner] + lengths * number
        panel = collocate(LinearSystem(self._scaled_dynamics, self._weights), starts, ends)

        onward = self._closed_form(ends, last[owner])
        onward[begins + counts - 1] = np.eye(6)
        gramian = np.add.reduceat(onward @ panel.gramian @ np.swapaxes(onward, -1, -2), begins)
        held = np.add.reduceat(onward @ panel.held, begins)
        is_short = (counts == 1)[:, None, None]
        transition = np.where(is_short, panel.transition[begins], self._closed_form(first, last))
        return HeldSegment(transition, gramian, held)

    def _closed_form(self, first: Floats, last: Floats) -> Floats:
        """Return the transition in scaled variables, shape (..., 6, 6): Yamanaka and Ankersen's equation (84)."""
        e = self.orbit.eccentricity
        start, end = self._place(first), self._place(last)
        shift = (end.mean_rad - start.mean_rad) / (1.0 - e * e) ** 1.5
        return self._from_constants(end, shift) @ self._to_constants(start)

    def _from_constants(self, place: _Place, shift: Floats) -> Floats:
        """Return the matrix from the constants of the motion to the scaled state; `shift` is k^2 (t - t_0)."""
        e, rho = self.orbit.eccentricity, place.rho
        s, c = rho * place.sine, rho * place.cosine
        matrix = np.zeros((*np.broadcast_shapes(rho.shape, shift.shape), 6, 6))
        matrix[..., 0, 1] = s
        matrix[..., 0, 2] = c
        matrix[..., 0, 3] = 2.0 - 3.0 * e * s * shift
        matrix[..., 1, 0] = 1.0
        matrix[..., 1, 1] = (rho + 1.0) * place.cosine
        matrix[..., 1, 2] = -(rho + 1.0) * place.sine
        matrix[..., 1, 3] = -3.0 * rho**2 * shift
        s_rate = place.cosine * rho - e * place.sine**2
        c_rate = -place.sine * rho - e * place.sine * place.cosine
        matrix[..., 3, 1] = s_rate
        matrix[..., 3, 2] = c_rate
        matrix[..., 3, 3] = -3.0 * e * (s_rate * shift + place.sine / rho)
        matrix[..., 4, 1] = -2.0 * s
        matrix[..., 4, 2] = e - 2.0 * c
        matrix[..., 4, 3] = -3.0 * (1.0 - 2.0 * e * s * shift)
        matrix[..., 2, 4] = matrix[..., 5, 5] = place.cosine
        matrix[..., 2, 5] = place.sine
        matrix[..., 5, 4] = -place.sine
        return matrix

    def _to_constants(self, place: _Place) -> Floats:
        """Return the inverse of `_from_constants` without shift: Yamanaka and Ankersen's equation (82)."""
        e, rho = self.orbit.eccentricity, place.rho
        s, c = rho * place.sine, rho * place.cosine
        matrix = np.zeros((*rho.shape, 6, 6))
        matrix[..., 0, 0] = -3.0 * e * place.sine * (1.0 + 1.0 / rho)
        matrix[..., 0, 3] = e * c - 2.0
        matrix[..., 0, 4] = -e * place.sine * (rho + 1.0)
        matrix[..., 1, 0] = -3.0 * place.sine * (1.0 + e * e / rho)
        matrix[..., 1, 3] = c - 2.0 * e
        matrix[..., 1, 4] = -place.sine * (rho + 1.0)
        matrix[..., 2, 0] = -3.0 * (place.cosine + e)
        matrix[..., 2, 3] = -s
        matrix[..., 2, 4] = -place.cosine * (rho + 1.0) - e
        matrix[..., 3, 0] = 3.0 * rho + e * e - 1.0
        matrix[..., 3, 3] = e * s
        matrix[..., 3, 4] = rho**2
        matrix /= 1.0 - e * e
        matrix[..., 0, 1] = 1.0
        matrix[..., 4, 2] = matrix[..., 5, 5] = place.cosine
        matrix[..., 4, 5] = -place.sine
        matrix[..., 5, 2] = place.sine
        return matrix

    def _scaled_dynamics(self, sigma: Floats) -> Floats:
        """Return the matrix of d(x, x') / d sigma, shape (..., 6, 6)."""
        place = self._place(sigma)
        matrix = np.zeros((*sigma.shape, 6, 6))
        matrix[..., 0, 3] = matrix[..., 1, 4] = matrix[..., 2, 5] = place.turning
        matrix[..., 3, 0] = 3.0 / place.rho * place.turning
        matrix[..., 3, 4] = 2.0 * place.turning
        matrix[..., 4, 3] = -2.0 * place.turning
        matrix[..., 5, 2] = -place.turning
        return matrix

    def _weights(self, sigma: Floats) -> tuple[Floats, Floats]:
        """Return the weights of the held control and of the Gramian: a control changes x' by u dt / (k^2 rho)."""
        place, rate = self._place(sigma), self.orbit.semi_latus_rate_rad_s
        time_rate = place.turning / (rate * place.rho**2)
        effect = 1.0 / (rate * place.rho)
        return effect * time_rate, effect**2 * time_rate

    def _to_scaled(self, sigma: Floats) -> Floats:
        """Return the matrix from position and velocity to the scaled state, shape (..., 6, 6)."""
        place, rate = self._place(sigma), self.orbit.semi_latus_rate_rad_s
        return _of_blocks(place.rho, -self.orbit.eccentricity * place.sine, 1.0 / (rate * place.rho))

    def _from_scaled(self, sigma: Floats) -> Floats:
        """Return the inverse of `_to_scaled`."""
        place, rate = self._place(sigma), self.orbit.semi_latus_rate_rad_s
        return _of_blocks(1.0 / place.rho, rate * self.orbit.eccentricity * place.sine, rate * place.rho)

    @property
    def _kappa(self) -> float:
        e = self.orbit.eccentricity
        return float(((1.0 - e) / (1.0 + e)) ** 0.25)

    def _intermediate(self, eccentric: Floats) -> Floats:
        fraction = (1.0 - self._kappa) / (1.0 + self._kappa)
        ahead = np.arctan2(fraction * np.sin(eccentric), 1.0 - fraction * np.cos(eccentric))
        return np.asarray(eccentric + 2.0 * ahead)

    def _place(self, sigma: Floats) -> _Place:
        e, kappa = self.orbit.eccentricity, self._kappa
        # The half of the eccentric anomaly, in an increasing scale without cancellation at perigee.
        sine, cosine = kappa * np.sin(0.5 * sigma), np.cos(0.5 * sigma)
        size_squared = sine**2 + cosine**2
        sine_e = 2.0 * sine * cosine / size_squared
        distance = 1.0 - e + 2.0 * e * sine**2 / size_squared
        fraction = (1.0 - kappa) / (1.0 + kappa)
        eccentric = sigma - 2.0 * np.arctan2(fraction * np.sin(sigma), 1.0 + fraction * np.cos(sigma))
        root = np.sqrt(1.0 - e * e)
        return _Place(
            rho=(1.0 - e * e) / distance,
            sine=root * sine_e / distance,
            cosine=((cosine**2 - sine**2) / size_squared - e) / distance,
            mean_rad=eccentric - e * sine_e,
            turning=root / distance * kappa / size_squared,
        )


def _of_blocks(by_position: Floats, velocity_by_position: Floats, velocity_by_velocity: Floats) -> Floats:
    matrix = np.zeros((*by_position.shape, 6, 6))
    for axis in range(3):
        matrix[..., axis, axis] = by_position
        matrix[..., 3 + axis, axis] = velocity_by_position
        matrix[..., 3 + axis, 3 + axis] = velocity_by_velocity
    return matrix
