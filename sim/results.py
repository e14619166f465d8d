"""Results of a batch of engagements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import Enum
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.set_queries import MaskedFloats, MaskedIntegers
from infoset.sim.columns import (
    Cell,
    Column,
    columns,
    columns_with_values,
    csv_text,
    documented,
    fields_of,
    values_of,
)
from infoset.sim.miss_cause import MissCause, count_causes
from infoset.sim.statistics import HitEstimate, estimate_hits

MaskedFlags = np.ma.MaskedArray[tuple[int], np.dtype[np.bool_]]


class GuaranteeWarning(UserWarning):
    """A set lost the true state or became empty, or a miss exceeds the bound Phi."""


class Outcome(Enum):
    """How an engagement ended. Whether it hit is a separate column."""

    ARRIVED = "arrived"
    """The spacecraft flew to the closest approach, near or far, and no other outcome applies."""
    SET_EMPTY = "set-empty"
    """A measurement left the set empty although no label was below the threshold: measurements and
    model disagree.

    With recovery the last consistent set is enlarged and guidance continues; without it no more
    impulses are given.
    """
    BUDGET_SPENT = "budget-spent"
    """The budget fell below the minimum impulse while the strategy still commanded one."""
    DIVERGED = "diverged"
    """The miss is greater than the nominal range."""


_PHI = (
    "Bound Phi of the miss (in the paper's model the published Phi, which is not a bound); "
    "unknown where no label left, or the data exceeded their error bounds"
)
_MARGIN = (
    "Smallest distance from the true state to the boundary of its section, negative outside; "
    "unknown where nothing was measured"
)
_HELD = "Miss at most the guaranteed miss; unknown without a guarantee"
_EMPTY = "A measurement left the set empty, whatever the outcome is"
_HIT = "Closest approach inside the body; unknown if the body has no size"
_CERTAIN = (
    "Whether the bound Phi is at most the radius around the aim point that is certainly inside the "
    "body: the hit was certain in flight; unknown without a bound"
)
_PROBABILITY = (
    "Probability that the closest approach is inside the ellipse of the body, whose direction is "
    "unknown"
)
_CAUSE = "Why the engagement missed the body; unknown for hits"
_UNGUIDED = "Miss without impulses, of the same true motion"
_ENGINE = "Maximum change of the miss by all impulses of the flight, without a limit of their sum"
_BUDGET = "Maximum change of the miss by impulses within the budget"
_LAST = "Radius of the possible misses at the last decision; unknown without a decision"
_REDRAWS = "Normal starts outside the dispersion that were drawn again; unknown for uniform starts"
_PROVED = (
    "Time at which a wrong image is proved; unknown without a proof, and if the set allows for none"
)
_SUSPECTED = (
    "Number of images one of which is the wrong one; unknown without a proof, and if more images "
    "are wrong than the set allows for"
)
_NAMED = "Time of the wrong image, if one image is suspected"
_B_DOT_T = "B.T of the centre at its closest approach; unknown without a reference plane"

_optional = partial(Column, nullable=True, optional=True)


@documented
@dataclass(frozen=True)
class Results:
    """Results of a batch of B engagements.

    A column of results is declared at its field here; CSV, JSON, Parquet and record files follow
    the declaration.

    Parameters
    ----------
    guarantees : bool
        Whether `guaranteed_miss_m` is a bound: the set's model is the guaranteed one.
    burns_m_s : ndarray, shape (B, n), or None
        Moduli of the impulses at the times of the schedule, m/s; None without a schedule, and for
        results from files.
    b_plane_t_rad : float or None
        Direction of the axis T of the B-plane from y toward z, rad; None without a reference plane.
    """

    runs: Integers = field(metadata=columns(Column("run", "", "Run number", int)))
    miss_m: Floats = field(
        metadata=columns(
            Column("miss_m", "m", "Minimum distance from the aim point, by default the centre")
        )
    )
    impulse_m_s: Floats = field(
        metadata=columns(Column("impulse_m_s", "m/s", "Sum of the impulses' moduli"))
    )
    guaranteed_miss_m: MaskedFloats = field(
        metadata=columns(Column("guaranteed_miss_m", "m", _PHI, nullable=True))
    )
    outcomes: tuple[Outcome, ...] = field(
        metadata=columns(Column("outcome", "", "How the engagement ended", Outcome))
    )
    set_emptied: Flags = field(metadata=columns(Column("set_emptied", "", _EMPTY, bool)))
    hit: MaskedFlags = field(metadata=columns(Column("hit", "", _HIT, bool, nullable=True)))
    causes: tuple[MissCause | None, ...] = field(
        metadata=columns(Column("cause", "", _CAUSE, MissCause, nullable=True))
    )
    unguided_miss_m: Floats = field(metadata=columns(Column("unguided_miss_m", "m", _UNGUIDED)))
    engine_corrects_m: Floats = field(metadata=columns(Column("engine_corrects_m", "m", _ENGINE)))
    budget_corrects_m: Floats = field(metadata=columns(Column("budget_corrects_m", "m", _BUDGET)))
    last_possible_m: MaskedFloats = field(
        metadata=columns(Column("last_possible_m", "m", _LAST, nullable=True))
    )
    truth_kept: Flags = field(
        init=False,
        metadata=columns(
            Column("truth_kept", "", "True state inside its section at every step", bool)
        ),
    )
    truth_margin_m: MaskedFloats = field(
        metadata=columns(Column("truth_margin_m", "m", _MARGIN, nullable=True))
    )
    phi_held: MaskedFlags = field(
        init=False, metadata=columns(Column("phi_held", "", _HELD, bool, nullable=True))
    )
    position_m: Floats = field(
        metadata=columns(
            _optional("start_y_m", "m", "True y at the start, only in space"),
            Column("start_z_m", "m", "True z at the start"),
            Column("start_x_m", "m", "true x"),
        )
    )
    velocity_m_s: Floats = field(
        metadata=columns(
            _optional("start_vy_m_s", "m/s", "True V_y at the start, only in space"),
            Column("start_vz_m_s", "m/s", "true V_z"),
            Column("start_vx_m_s", "m/s", "true V_x"),
        )
    )
    lateral_miss_m: Floats = field(
        metadata=columns(
            _optional(
                "miss_y_m", "m", "True y of the centre at the closest approach, only in space"
            ),
            Column("miss_z_m", "m", "true z"),
        )
    )
    b_plane_m: Floats = field(
        init=False,
        metadata=columns(_optional("b_dot_t_m", "m", _B_DOT_T), _optional("b_dot_r_m", "m", "B.R")),
    )
    certain_hit: MaskedFlags | None = field(
        default=None, metadata=columns(_optional("certain_hit", "", _CERTAIN, bool))
    )
    hit_probability: MaskedFloats | None = field(
        default=None, metadata=columns(_optional("hit_probability", "", _PROBABILITY))
    )
    redraws: Integers | None = field(
        default=None, metadata=columns(_optional("redraws", "", _REDRAWS, int))
    )
    wrong_image_proved_s: MaskedFloats | None = field(
        default=None,
        metadata=columns(
            Column("wrong_image_proved_s", "s", _PROVED, nullable=True, optional=True)
        ),
    )
    suspected_images: MaskedIntegers | None = field(
        default=None, metadata=columns(_optional("suspected_images", "", _SUSPECTED, int))
    )
    wrong_image_s: MaskedFloats | None = field(
        default=None, metadata=columns(_optional("wrong_image_s", "s", _NAMED))
    )
    guarantees: bool = False
    burns_m_s: Floats | None = None
    b_plane_t_rad: float | None = None

    def __post_init__(self) -> None:
        unknown = np.ma.getmaskarray(self.guaranteed_miss_m) | (not self.guarantees)
        within = self.miss_m <= self.guaranteed_miss_m.filled(np.inf)
        # Without a measurement nothing has removed the true state.
        object.__setattr__(self, "truth_kept", self.truth_margin_m.filled(0.0) >= 0.0)
        object.__setattr__(self, "phi_held", np.ma.MaskedArray(within, mask=unknown))
        object.__setattr__(self, "b_plane_m", b_plane(self.lateral_miss_m, self.b_plane_t_rad))

    def __len__(self) -> int:
        return len(self.runs)

    @property
    def hits(self) -> HitEstimate | None:
        """Probability of a hit with its confidence interval; None if the body has no size."""
        runs = int(self.hit.count())
        return estimate_hits(int(self.hit.sum()), runs) if runs else None

    @property
    def missed(self) -> dict[str, Any]:
        """Number of misses of each cause, and their explanation (`miss_cause.count_causes`)."""
        causes = np.array([cause and cause.value for cause in self.causes], dtype=object)
        return count_causes(
            causes, self.unguided_miss_m, self.engine_corrects_m, self.last_possible_m.filled(0.0)
        )

    @property
    def failures(self) -> str:
        """Number of runs whose set or bound Phi failed, as text; empty if none did."""
        failed_sets = int((~self.truth_kept | self.set_emptied).sum())
        exceeded = int((~self.phi_held.filled(True)).sum())
        found = []
        if failed_sets:
            found.append(
                f"in {failed_sets} of {len(self)} runs the set lost the true state or became empty"
            )
        if exceeded:
            found.append(
                f"in {exceeded} of {int(self.phi_held.count())} runs the miss exceeds the bound Phi"
            )
        return ", ".join(found)

    @property
    def redrawn_share(self) -> float | None:
        """Share of the normal starts that were drawn again because they were outside the
        dispersion; None for uniform starts.
        """
        if self.redraws is None:
            return None
        return float(1.0 - len(self) / (len(self) + self.redraws.sum()))

    def to_dict(self) -> dict[str, list[Any]]:
        """Return the columns by name as plain values, one per run; None is unknown."""
        return {column.name: values_of(self, column) for column in columns_with_values(self)}

    def to_csv(self) -> str:
        """Return the columns as comma-separated values, one row per run.

        An unknown value is an empty cell; numbers have all their digits. `infoset.save` writes them
        to a file.
        """
        table = self.to_dict()
        return csv_text(list(table), list(zip(*table.values(), strict=True)))

    def to_pandas(self) -> Any:
        """Return the columns as a pandas `DataFrame`, one row per run.

        The units are in ``frame.attrs["units"]``.
        """
        import pandas as pd  # installed with the extra `campaign`

        frame = pd.DataFrame(self.to_dict())
        frame.attrs["units"] = {column.name: column.unit for column in columns_with_values(self)}
        return frame

    def take(self, indices: NDArray[np.intp]) -> Results:
        """Return the results at some indices, in the order of the indices."""

        def taken(values: Any) -> Any:
            if isinstance(values, tuple):
                return tuple(values[index] for index in indices)
            return values[indices] if isinstance(values, np.ndarray) else values

        return Results(**{name: taken(getattr(self, name)) for name in _INPUTS})

    def __repr__(self) -> str:
        miss = np.median(self.miss_m)
        fuel = np.median(self.impulse_m_s)
        hits = "" if self.hits is None else f", {self.hits.hits} hit"
        failures = f"; {self.failures}" if self.failures else ""
        return (
            f"<{len(self)} engagements{hits}: median miss {miss:.3g} m for {fuel:.4g} "
            f"m/s{failures}>"
        )


def from_columns(
    table: Mapping[str, Sequence[Cell]],
    *,
    guarantees: bool,
    burns_m_s: Sequence[Sequence[float]] | None,
    b_plane_t_rad: float | None,
) -> Results:
    """Return results from the columns of `Results.to_dict` and the values that are not columns.

    A ValueError is raised if they do not agree.
    """
    if not isinstance(table, Mapping) or not isinstance(guarantees, bool):
        raise ValueError("columns must be a table, and guarantees true or false")
    arguments = fields_of(Results, table)
    burns = None
    if burns_m_s is not None:
        burns = np.array(burns_m_s, dtype=float)
        is_table = burns.ndim == 2 and len(burns) == len(arguments["runs"])
        if not is_table or not np.isfinite(burns).all():
            raise ValueError("burns_m_s must have one row of numbers for each run")
    if b_plane_t_rad is not None and not np.isfinite(float(b_plane_t_rad)):
        raise ValueError("b_plane_t_rad must be a number")
    return Results(**arguments, guarantees=guarantees, burns_m_s=burns, b_plane_t_rad=b_plane_t_rad)


def ending(outcome: str, hit: bool | None, cause: str | None) -> str:
    """Return the outcome as text, with `hit`, or `missed` and the cause, if the body has a size."""
    if hit is None:
        return outcome
    return f"{outcome}, hit" if hit else f"{outcome}, missed ({cause})"


def b_plane(lateral_m: Floats, t_rad: float | None) -> Floats:
    """Return (B.T, B.R) of positions (y, z), shape (B, 2); shape (B, 0) without a reference plane.

    (y, z) are positions of the object across the approach. B points from the object to the
    spacecraft, opposite to (y, z). `t_rad` is the direction of T from y toward z.
    """
    if t_rad is None:
        return np.empty((len(lateral_m), 0))
    cosine = np.cos(t_rad)
    sine = np.sin(t_rad)
    return np.asarray(-lateral_m @ np.array([[cosine, -sine], [sine, cosine]]))


_INPUTS = [declared.name for declared in fields(Results) if declared.init]


def join(parts: Sequence[Results]) -> Results:
    """Return the results of several batches as one, in their order."""
    return Results(**{name: _joined([getattr(part, name) for part in parts]) for name in _INPUTS})


def _joined(parts: Sequence[Any]) -> Any:
    """Return the values of one field of several results as one value."""
    first = parts[0]
    if isinstance(first, bool):
        return all(parts)  # guarantees
    # b_plane_t_rad, or an absent array: equal in all parts, which are of one scenario.
    if first is None or isinstance(first, float):
        return first
    if isinstance(first, tuple):
        return tuple(value for part in parts for value in part)
    if isinstance(first, np.ma.MaskedArray):
        return np.ma.concatenate(parts)  # type: ignore[no-untyped-call]
    return np.concatenate(parts)
