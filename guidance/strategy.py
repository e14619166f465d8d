"""The contract of a guidance strategy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from guidance.situation import Situation
from infoset.arrays import Flags, Floats
from infoset.limits import shown


def start(strategy: Strategy, batch: int, axes: Sequence[str]) -> list[Any]:
    """Return the states of a strategy for `decide`: one for each lateral axis, or one if it decides for both axes."""
    check_axes(strategy, axes)
    return [strategy.start(batch) for _ in (axes[:1] if _is_spatial(strategy) else axes)]


def check_axes(strategy: Strategy, axes: Sequence[str]) -> None:
    """Raise ValueError if a strategy for both lateral axes (``spatial = True``) is used in a plane."""
    if _is_spatial(strategy) and len(axes) == 1:
        raise ValueError(
            f"strategy {type(strategy).__name__} decides for both lateral axes (its class has `spatial = True`), and "
            "the scenario is in a plane: use a scenario in space, or a strategy without `spatial = True`"
        )


def decide(strategy: Strategy, situation: Situation, states: Sequence[Any], tracking: Flags) -> Floats:
    """Return the impulses of a step, m/s, shape (B,); in space (2, B), along y and z.

    In space, a strategy that decides for one axis gets the planar situation of each axis. `states` is the return value
    of `start`. The impulses of engagements that are not `tracking`, shape (B,), need not be finite.
    """
    if _is_spatial(strategy):
        return checked_impulses(strategy.decide(situation, states[0]), situation, tracking, strategy)
    planar = [situation.axis(name) for name in situation.axes]
    wanted = [
        checked_impulses(strategy.decide(one, state), one, tracking, strategy)
        for one, state in zip(planar, states, strict=True)
    ]
    return wanted[0] if len(wanted) == 1 else np.stack(wanted)


def _is_spatial(strategy: Strategy) -> bool:
    return bool(getattr(strategy, "spatial", False))


def checked_impulses(wanted: object, situation: Situation, tracking: Flags, strategy: object) -> Floats:
    """Return the impulses of a strategy as an array; raise ValueError for numbers that are not real or not finite."""
    values, shape = np.asarray(wanted), situation.last_impulse_m_s.shape
    real = values.dtype.kind in "fiu" and not isinstance(wanted, np.ma.MaskedArray)
    if real and values.shape == shape and (np.isfinite(values) | ~tracking).all():
        return values.astype(np.float64, copy=False)
    needed = f"{shape[-1]} finite impulses (m/s), one for each engagement"
    if len(shape) > 1:
        needed = f"finite impulses (m/s) of the shape {shape}, along y and z"
    elif values.shape == (2, *shape):
        needed += " (for both axes at once, set `spatial = True` in its class)"
    raise ValueError(
        f"strategy {type(strategy).__name__} must return {needed}, real and not masked: at step {situation.step} it "
        f"returned shape {values.shape}, {shown(wanted)}"
    )


class Strategy(Protocol):
    """A rule that computes the impulses of a batch of engagements from what is known on board.

    The thruster limits the impulses that a strategy returns. Where an engagement has no set
    (`situation.predicted_miss.exists` is False) they are ignored.

    In space, a strategy is applied to each lateral axis: `start` once for each axis, `decide` with the planar situation
    of the axis. A strategy whose class has the attribute ``spatial = True`` gets the whole situation, with arrays of
    shape (2, B), and returns impulses of shape (2, B), along y and z.
    """

    def start(self, batch: int) -> Any:
        """Return the state of the strategy for `batch` engagements, or None."""

    def decide(self, situation: Situation, state: Any) -> Floats:
        """Return the impulses of a step along z, m/s, shape (B,).

        The state is the return value of `start`; it may be changed.
        """
