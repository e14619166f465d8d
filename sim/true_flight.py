"""True motions of a batch with their targets, until the closest approach and x = 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, some
from infoset.sim.draws import Draws
from infoset.sim.kepler import KeplerMotion, Sight
from infoset.sim.scenario import Scenario
from infoset.sim.target import acceleration_m_s2


class Miss(NamedTuple):
    """Minimum distances from the aim point (m, shape (B,)), and lateral positions of the centre (m,
    shape (C, B)) at its closest approach.
    """

    distance_m: Floats
    lateral_m: Floats


class TrueFlight:
    """True motions of B engagements, with the accelerations of their targets.

    `motion` and `target_m_s2`, shape (C, B, steps), replace the Kepler motion and the accelerations
    of the targets of the scenario.

    Attributes
    ----------
    flying : ndarray of bool, shape (B,)
        Engagements before their closest approach.
    arrived : ndarray of bool, shape (B,)
        Engagements after their closest approach and after x = 0, where the label leaves the set.
    """

    def __init__(
        self,
        scenario: Scenario,
        draws: Draws,
        motion: KeplerMotion | None = None,
        target_m_s2: Floats | None = None,
    ) -> None:
        batch, components = draws.position_m.shape
        self._motion = motion or KeplerMotion(
            draws.position_m,
            draws.velocity_m_s,
            scenario.sun,
            scenario.engine.acceleration_m_s2,
        )
        self._step_s = scenario.set_model.step_s
        self._aim_m = scenario.set_model.lateral_aim_m[:, None]
        self._target = scenario.target
        self._target_draws = draws.target
        self._target_m_s2 = target_m_s2
        self.flying: Flags = np.ones(batch, dtype=bool)
        self.arrived: Flags = np.zeros(batch, dtype=bool)
        self._arrival_s = self._motion.arrival_s()
        self._distance_m = np.full(batch, np.inf)
        self._lateral_m = np.zeros((components - 1, batch))

    def sight(self) -> Sight:
        """Return the present geometry."""
        return self._motion.sight()

    def fire(self, executed_m_s: Floats) -> None:
        """Change the velocities by executed impulses, shape (C, B), m/s."""
        self._motion.fire(executed_m_s)

    def advance(
        self, step: int, sight: Sight, impulse_m_s: Floats, noise_side: Floats | None
    ) -> None:
        """Simulate one step, and detect the closest approaches and the arrivals within it.

        `sight` is the geometry before the impulse of the step, and `noise_side` is the side to
        which the noise shifts the true state: a worst-case target accelerates to that side. Where
        it is zero, and if it is None, the target accelerates to the side of its predicted miss.
        """
        target_m_s2 = self._acceleration_m_s2(step, sight, impulse_m_s, noise_side)
        passage = self._motion.advance(self._step_s, target_m_s2)

        # A target that accelerates can return before x = 0, and Phi bounds the minimum distance
        # until then.
        passed = passage.passed & ~self.arrived
        if some(passed):
            self._distance_m = np.where(passed, passage.min_distance_m, self._distance_m)
            self._lateral_m = np.where(passed, passage.lateral_m, self._lateral_m)

        passes_now = self.flying & passed
        if some(passes_now):
            arrival_s = step * self._step_s + passage.arrival_s
            self._arrival_s = np.where(passes_now, arrival_s, self._arrival_s)
            self.flying &= ~passes_now

        # The label leaves at x = 0, which may come after the closest approach.
        if not self.flying.all():
            self.arrived |= ~self.flying & (self._arrival_s <= (step + 1) * self._step_s)

    def arrivals_s(self, step: int) -> Floats:
        """Return the times of x = 0 since the start, s, shape (B,), at the beginning of a step.

        For flights before their closest approach it is the time without further impulses.
        """
        if not self.flying.any():
            return self._arrival_s
        ahead_s = step * self._step_s + self._motion.arrival_s()
        return np.where(self.flying, ahead_s, self._arrival_s)

    def miss(self) -> Miss:
        """Return the misses; without a closest approach so far, the present distance from the aim
        point and position.
        """
        passed = np.isfinite(self._distance_m)
        present_m = self._motion.position_m.T
        distance_m = np.where(passed, self._distance_m, self._motion.sight().range_m)
        lateral_m = np.where(passed, self._lateral_m, present_m[:-1])
        # The stored distances are those of the centre.
        if self._aim_m.any():
            distance_m = np.where(
                passed,
                self._distance_from_aim_m(lateral_m),
                np.hypot(np.hypot.reduce(lateral_m + self._aim_m), present_m[-1]),
            )
        return Miss(distance_m, lateral_m)

    def _distance_from_aim_m(self, lateral_m: Floats) -> Floats:
        """Return the minimum distances from the aim point, m, from those of the centre.

        The motion is straight between the two approaches, which are metres apart. At the approach
        of the centre r . v = 0, which gives x. The minimum distance of the aim point has the square
        |r + a|^2 - (a . v)^2 / v^2. The present velocity is used in place of the velocity v of the
        approach.
        """
        velocity = self._motion.velocity_m_s.T
        x_m = -(lateral_m * velocity[:-1]).sum(axis=0) / velocity[-1]
        along_m = (self._aim_m * velocity[:-1]).sum(axis=0) / np.hypot.reduce(velocity)
        across_m = np.hypot(np.hypot.reduce(lateral_m + self._aim_m), x_m)
        squared = (across_m - along_m) * (across_m + along_m)
        return np.asarray(np.sqrt(np.maximum(squared, 0.0)))

    def _acceleration_m_s2(
        self, step: int, sight: Sight, impulse_m_s: Floats, noise_side: Floats | None
    ) -> Floats | None:
        """Return the accelerations of the targets over a step, m/s^2, shape (C, B).

        None without a target that manoeuvres: the motion keeps its acceleration, which is zero.
        """
        if self._target_m_s2 is not None:
            return np.asarray(self._target_m_s2[:, :, step])
        if self._target is None or self._target_draws is None:
            return None

        # Signed misses of the true states without further impulses.
        # The velocity across the line of sight, less the impulse, times the time to x = 0.
        left_s = np.maximum(self._arrival_s - step * self._step_s, 0.0)
        centre_m = (sight.omega_rad_s * sight.range_m - impulse_m_s) * left_s
        predicted_m = np.asarray(centre_m + self._aim_m)
        if noise_side is not None:
            predicted_m = np.where(noise_side == 0.0, predicted_m, noise_side)
        return acceleration_m_s2(self._target, self._target_draws, step, self._step_s, predicted_m)
