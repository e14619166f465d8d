"""Paths of extremals and of steered craft."""

from __future__ import annotations

import numpy as np

from infoset.rendezvous.pursuit_evasion import CaptureSolution
from infoset.rendezvous.pursuit_evasion.game import scaled_craft
from infoset.rendezvous.pursuit_evasion.paths import extremal_paths


def test_acceleration_of_an_extremal_at_its_end_is_its_limit(solved: CaptureSolution) -> None:
    assert solved.capture is not None
    game = solved.game
    pursuer = scaled_craft(game.pursuer, game.gravity, solved.units)
    evader = scaled_craft(game.evader, game.gravity, solved.units)
    for path in extremal_paths(pursuer, evader, solved.capture.extremal):
        before = path.duration * (1.0 - 1e-6)

        _, at_end = path.state_at(path.duration)
        _, limit = path.state_at(before)

        # The acceleration changes by about its size times the angle of the orbit in between.
        np.testing.assert_allclose(at_end, limit, atol=1e-4 * float(np.linalg.norm(limit)))
        thrust = path.craft.thrust / (path.craft.mass - path.craft.flow * path.duration)
        assert thrust > 1e-3 * np.linalg.norm(limit)
