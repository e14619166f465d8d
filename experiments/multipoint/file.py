"""Problem files of kind `multipoint`: the tour of the core that they describe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.common.errors import InputError
from experiments.common.problem_file import problem_form, problem_hash
from experiments.common.toml_file import load_tables
from experiments.common.toml_values import KILO, radians, si
from experiments.multipoint.tables import KIND, Axes, BodyTable, MultipointTables, checks
from rendezvous.multipoint import DriftingTargets, KeplerTargets, KeplerTour, Target, TimeLimits, Tour, Visits
from rendezvous.orbital_elements import OrbitalElements
from rendezvous.relative_motion import ClohessyWiltshire, EllipticOrbit, LinearMotion, TschaunerHempel
from rendezvous.two_body import coast

Floats = NDArray[np.float64]

FORM = problem_form(KIND, MultipointTables, checks)


@dataclass(frozen=True, eq=False)
class MultipointProblem:
    """A problem as read.

    Parameters
    ----------
    name : str
    source : str
        What it was read from.
    hash : str
        Of every value but name and description.
    axes : Axes
    tour : Visits
    times_s : ndarray, shape (n,), or None
        Of the targets as listed; None where one is missing.
    optimise : bool
        Whether times are optimised.
    latest_s : float or None
    least_gap_s, price_per_s : float
    greatest_control_m_s2 : float or None
    """

    name: str
    source: str
    hash: str
    axes: Axes
    tour: Visits
    times_s: Floats | None
    optimise: bool
    latest_s: float | None
    least_gap_s: float
    price_per_s: float
    greatest_control_m_s2: float | None

    def limits(self) -> TimeLimits:
        """Return what holds the times.

        Returns
        -------
        TimeLimits

        Raises
        ------
        InputError
            If nothing holds the last one.
        """
        try:
            return TimeLimits(self.latest_s, self.least_gap_s, self.price_per_s)
        except ValueError as error:
            raise InputError(f"{self.source}: {error}: latest_s or price_per_s under [times]") from None


def load_multipoint(name_or_path: str) -> MultipointProblem:
    """Read a built-in problem or a file.

    Parameters
    ----------
    name_or_path : str

    Returns
    -------
    MultipointProblem

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    tables = load_tables(FORM, name_or_path)
    try:
        tour = _hill(tables) if tables.axes is Axes.HILL else _inertial(tables)
    except ValueError as error:
        raise InputError(f"{name_or_path}: {error}") from None
    times = [each.time_s for each in tables.target]
    known = [si(each) for each in times if each is not None]
    latest, bound = tables.times.latest_s, tables.greatest_control_m_s2
    return MultipointProblem(
        tables.name,
        name_or_path,
        problem_hash(tables),
        tables.axes,
        tour,
        np.array(known) if len(known) == len(times) else None,
        tables.times.optimise,
        None if latest is None else si(latest),
        si(tables.times.least_gap_s),
        si(tables.times.price_per_s),
        None if bound is None else si(bound),
    )


def _described(tables: MultipointTables) -> tuple[Target, ...]:
    return tuple(Target(each.name, each.meet, si(each.dwell_s)) for each in tables.target)


def _hill(tables: MultipointTables) -> Tour:
    assert tables.orbit_rate_rad_s is not None
    rate, eccentricity = si(tables.orbit_rate_rad_s), si(tables.eccentricity)
    motion: LinearMotion = ClohessyWiltshire(rate)
    if eccentricity > 0.0:
        motion = TschaunerHempel(EllipticOrbit(rate, eccentricity, radians(tables.true_anomaly_deg)))
    initial = np.array([_relative(each) for each in tables.target])
    return Tour(motion, DriftingTargets(_described(tables), motion, initial), _relative(tables.chaser))


def _inertial(tables: MultipointTables) -> KeplerTour:
    assert tables.gravitational_parameter_km3_s2 is not None
    mu = si(tables.gravitational_parameter_km3_s2, 3 * KILO)
    states, epochs = zip(*(_absolute(each, mu) for each in tables.target), strict=True)
    targets = KeplerTargets(_described(tables), np.array(states), np.array(epochs), mu)
    try:
        targets.states(np.arange(len(states)), targets.epoch_s)
        chaser, epoch_s = _absolute(tables.chaser, mu)
        return KeplerTour(targets, coast(chaser, -epoch_s, mu))
    except ValueError as error:
        raise ValueError(f"{error}; check the units of states and of gravitational_parameter_km3_s2") from None


def _relative(body: BodyTable) -> Floats:
    assert body.position_m is not None
    assert body.velocity_m_s is not None
    return np.array([si(each) for each in (*body.position_m, *body.velocity_m_s)])


def _absolute(body: BodyTable, mu: float) -> tuple[Floats, float]:
    """Inertial state at its epoch, and the epoch."""
    if body.elements is not None:
        axis, eccentricity, *angles, epoch = body.elements
        orbit = OrbitalElements(si(axis, KILO), si(eccentricity), *(radians(each) for each in angles))
        return np.concatenate(orbit.state(mu)), si(epoch)
    assert body.position_km is not None
    assert body.velocity_km_s is not None
    return np.array([si(each, KILO) for each in (*body.position_km, *body.velocity_km_s)]), si(body.epoch_s)
