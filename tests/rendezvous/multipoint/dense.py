"""The paper's dense system for the costates and their jumps: a check of the segment solver."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.rendezvous.multipoint.segments import Nodes, check_times
from infoset.rendezvous.relative_motion import LinearMotion


def solve_dense(
    motion: LinearMotion, start_s: float, start_state: Floats, nodes: Nodes
) -> tuple[float, Floats]:
    """Solve Q P = Delta, (14) of Mironov and Mironov (2007), from the `start_state`, for `nodes`
    without a rendezvous.

    Returns the cost, m^2/s^3, and the velocities of the chaser at the nodes, m/s, shape (N, 3).

    Raises
    ------
    ValueError
        If a node is a rendezvous, or times do not increase.

    Notes
    -----
    Q12(t, s) = G(t, s) Phi(s, t)' gives R13 and R14, Q22(t, s) = Phi(s, t)' gives R43 and R44.
    O(N^2) Gramians, O(N^3) time: a check up to N about 100, as the condition number grows
    approximately as N^6. `motion` is the chaser's.
    """
    if nodes.rendezvous.any():
        raise ValueError("the dense system of the paper knows flybys only")
    check_times(start_s, nodes.arrive_s, nodes.leave_s)
    times = nodes.arrive_s
    count = len(nodes.arrive_s)
    sources = np.concatenate([[start_s], times[:-1]])
    segment = motion.segment(start_s, times)
    coast = np.einsum("kab,b->ka", segment.transition, start_state)
    matrix = np.zeros((3 * count + 3, 3 * count + 3))
    by_velocity = np.zeros_like(matrix[:-3])
    for row in range(count):
        # Column blocks: lambda_r0, lambda_V0, then the jumps at earlier nodes.
        reach = np.full(row + 1, times[row])
        back = motion.transition(reach, sources[: row + 1])
        effect = motion.gramian(sources[: row + 1], reach) @ np.swapaxes(back, 1, 2)
        for target, block in ((matrix, effect[:, :3]), (by_velocity, effect[:, 3:])):
            rows = target[3 * row : 3 * row + 3]
            rows[:, :6] = block[0]
            rows[:, 6 : 6 + 3 * row] = np.swapaxes(block[1:, :, :3], 0, 1).reshape(3, 3 * row)
        if row == count - 1:
            adjoint = np.swapaxes(back, 1, 2)
            matrix[-3:, :6] = adjoint[0, 3:]
            matrix[-3:, 6:] = np.swapaxes(adjoint[1:, 3:, :3], 0, 1).reshape(3, 3 * row)
    right = np.concatenate([(nodes.arrive - coast)[:, :3].ravel(), np.zeros(3)])
    rows = np.abs(matrix).max(axis=1)
    columns = np.abs(matrix).max(axis=0)
    rows = np.where(rows > 0.0, rows, 1.0)
    columns = np.abs(matrix / rows[:, None]).max(axis=0)
    solved = np.linalg.solve(matrix / rows[:, None] / columns, right / rows) / columns
    # The paper's unknowns are lambda+ minus lambda-.
    jumps = np.empty((count, 3))
    jumps[:-1] = -solved[6:].reshape(-1, 3)
    adjoint = np.swapaxes(motion.transition(np.full(count, times[-1]), sources), 1, 2)[:, :3]
    jumps[-1] = adjoint[0] @ solved[:6] + np.einsum(
        "kab,kb->a", adjoint[1:, :, :3], solved[6:].reshape(-1, 3)
    )
    velocities = coast[:, 3:] + (by_velocity @ solved).reshape(count, 3)
    return 0.5 * float(jumps.ravel() @ right[:-3]), velocities
