"""The information set, and its read-only view for strategies and noises."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats, some
from infoset.engine.set_state import SetState
from infoset.limits import COUNT, NOT_NEGATIVE, PART, WHOLE, flags, real_array, shown
from infoset.model import SetModel
from infoset.set_queries import SetQueries


class InformationSetView(SetQueries):
    """Read-only view of an information set. It follows the set and cannot change it."""

    def copy(self) -> InformationSet:
        """Return an independent information set that starts from the state of this one."""
        twin = InformationSet.__new__(InformationSet)
        SetQueries.__init__(twin, self._state.copy())
        return twin


class InformationSet(InformationSetView):
    """All states (alpha, omega, x) that agree with the measurements and impulses so far.

    It is a batch of such sets, one for each engagement.

    Parameters
    ----------
    guarantee : bool
        Whether to compute the guaranteed miss Phi. Only the guaranteed model with a box as initial
        set has one. A run takes 1.1 to 1.9 times as long, with a rate sensor 1.4 to 9 times.

    Raises
    ------
    TypeError, ValueError
        If the model is not a `SetModel`, the batch is not a positive whole number, or the model has
        no labels.

    Examples
    --------
    >>> from infoset import AngleSensor, InformationSet, SetModel, StateBox
    >>> known = StateBox(
    ...     z_m=(-10e3, 10e3), x_m=(5.3e6, 6.3e6), vz_m_s=(-100.0, 100.0), vx_m_s=(-59e3, -57e3)
    ... )
    >>> sensor = AngleSensor(0.5, 0.00015, 0.00023, nominal_range_m=5.8e6)
    >>> model = SetModel(58e3, 0.5, known, sensor, disturbance_m_s2=0.005, sections=5)
    >>> information = InformationSet(model)
    >>> information
    <InformationSet of 1 at t = 0 s>
    >>> information.measure_angle(0.0004)
    >>> information.shift(2.0)
    >>> information.predict()
    >>> information.sections()[0].polygons
    ConvexPolygons(shape=(1,), counts=[6])

    Notes
    -----
    The order inside one step: `measure_range`, `measure_angle`, `measure_rate`, `shift`,
    `drop_below_threshold`, `predict`.
    """

    def __init__(self, model: SetModel, batch: int = 1, *, guarantee: bool = True) -> None:
        if not isinstance(model, SetModel):
            raise TypeError(f"model must be a SetModel: got {shown(model)}")
        COUNT.need("batch", batch)
        super().__init__(SetState(model, batch, guarantee))

    def guaranteed_miss(self) -> tuple[Floats, Flags]:
        """Return the guaranteed miss Phi, an upper bound of the true miss.

        It holds if all errors are within their bounds.

        Returns
        -------
        phi_m : ndarray, shape (B,)
            m; zero while no feasible label has passed below the range threshold.
        exists : ndarray of bool, shape (B,)
            Whether the bound is valid: some label has passed below the threshold, the model is
            guaranteed, and the data never contradicted it.

        Notes
        -----
        Phi bounds the miss of the labels below the threshold. At arrival the label of the true
        state is below it.
        """
        state = self._state
        if state.phi is None:
            return np.zeros(self.batch), np.zeros(self.batch, dtype=bool)
        phi_m, exists = state.phi.bound(state.table, state.history)
        return phi_m, exists & ~self.inconsistent

    def view(self) -> InformationSetView:
        """Return a read-only view of this set; it follows the set."""
        return InformationSetView(self._state)

    def measure_range(
        self,
        range_m: ArrayLike,
        relative_error: float,
        where: ArrayLike = True,
        *,
        alpha_rad: ArrayLike | None = None,
        wrong_measurements: int = 0,
    ) -> None:
        """Keep the ranges that agree with a measurement: x_m/(1 + b) <= x <= x_m/(1 - b).

        Parameters
        ----------
        range_m : array_like, shape () or (B,)
            Measured range x_m, m.
        relative_error : float
            Bound b, in [0, 1).
        where : array_like of bool, shape () or (B,)
            Engagements with a measurement.
        alpha_rad : array_like, shape () or (C, B), or None
            Angles measured at the same time. In the guaranteed model the measured distance is x /
            cos(alpha); without a measured angle, alpha is bounded by the maximum possible
            displacement across x.
        wrong_measurements : int
            Maximum number of measured ranges of a flight that may have any error; the same at all
            of them.

        Raises
        ------
        TypeError, ValueError
            If a value is not finite, the range is negative, the error bound is not in [0, 1), or
            the number of wrong measurements is not a whole number.

        Notes
        -----
        A range measurement narrows the interval of labels and leaves the polygons of the labels in
        it unchanged.
        """
        PART.need("relative_error", relative_error)
        WHOLE.need("wrong_measurements", wrong_measurements)
        measured = real_array("range_m", range_m, (self.batch,))
        if some(measured < 0.0):
            raise ValueError(f"range_m must not be negative: got {shown(range_m)}")
        alpha = None
        if alpha_rad is not None and self.model.is_guaranteed:
            alpha = self._lateral("alpha_rad", alpha_rad)
        active = self._where(where)
        self._state.measure_range(measured, relative_error, alpha, active, wrong_measurements)

    def measure_angle(self, alpha_rad: ArrayLike, where: ArrayLike = True) -> None:
        """Cut every section by a line-of-sight angle measurement: |alpha - alpha_m| <= a + h(x).

        Parameters
        ----------
        alpha_rad : array_like, shape () or (C, B)
            Measured angle alpha_m along each lateral axis, rad.
        where : array_like of bool, shape () or (B,)
            Engagements with a measurement.
        """
        measured = self._lateral("alpha_rad", alpha_rad)
        self._state.measure_angle(measured, self._where(where))

    def measure_rate(
        self, omega_rad_s: ArrayLike, error_rad_s: float, where: ArrayLike = True
    ) -> None:
        """Cut every section by a measurement of the line-of-sight rate: |omega - omega_m| <= error.

        Parameters
        ----------
        omega_rad_s : array_like, shape () or (C, B)
            Measured rate of the plane angle along each lateral axis, rad/s.
        error_rad_s : float
            Error bound of the rate, rad/s.
        where : array_like of bool, shape () or (B,)
            Engagements with a measurement.

        References
        ----------
        Kumkov and Patsko (2001).
        """
        NOT_NEGATIVE.need("error_rad_s", error_rad_s)
        measured = self._lateral("omega_rad_s", omega_rad_s)
        self._state.measure_rate(measured, error_rad_s, self._where(where))

    def shift(self, impulse_m_s: ArrayLike, where: ArrayLike = True) -> None:
        """Shift every section by an impulse k: V becomes V - k, and omega becomes omega - k/x.

        Parameters
        ----------
        impulse_m_s : array_like, shape () or (C, B)
            Impulse k along each lateral axis, m/s.
        where : array_like of bool, shape () or (B,)
            Engagements with an impulse.
        """
        impulse = self._lateral("impulse_m_s", impulse_m_s)
        self._state.shift(impulse, self._where(where))

    def drop_below_threshold(self) -> Flags:
        """Remove the sections whose range will be below the threshold after the next step.

        Returns
        -------
        ndarray of bool, shape (B, S)
            Stored sections that were removed.
        """
        return self._state.drop_below_threshold()

    def sections_are_leaving(self) -> bool:
        """Return whether the range of a feasible section will be below the threshold after the next
        step.

        Then `drop_below_threshold` removes sections, except where the set is stopped.
        """
        state = self._state
        min_label = state.min_label_next
        if state.min_label >= min_label:
            return False
        return bool(((state.labels < min_label) & self.feasible).any())

    def predict(self) -> None:
        """Predict the set over one step, for all disturbances within the bound.

        The exact set of disturbances is a thin lens in (V, z). The paper's model replaces it by the
        segment between its ends, the guaranteed model by a parallelogram that contains it.
        """
        self._state.predict()

    def stop(self, where: ArrayLike) -> None:
        """Stop the computation in the engagements where `where`, shape () or (B,), is true."""
        self._state.stop(self._where(where))

    def _lateral(self, name: str, value: ArrayLike) -> Floats:
        """Return values along each axis, shape (C, B)."""
        return np.ascontiguousarray(real_array(name, value, (len(self.axes), self.batch)))

    def _where(self, where: ArrayLike) -> Flags:
        """Return a mask of engagements, shape (B,), or () for all of them."""
        return flags("where", where, (self.batch,))
