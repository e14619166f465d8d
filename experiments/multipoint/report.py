"""Results of `infoset multipoint`, as JSON and as a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from experiments.common.output import CONTROL_COLUMNS, STATE_COLUMNS, Cell, trajectories_csv
from experiments.common.screen import Part, number_table
from experiments.multipoint.command import BEST, GIVEN
from experiments.multipoint.file import Axes, MultipointProblem
from experiments.multipoint.scene import Scene
from infoset.arrays import Floats


@dataclass(frozen=True)
class Search:
    """Choice of order and times, each "given" or "best"."""

    order: str
    times: str

    @property
    def title(self) -> str:
        """Return the title of the progress bar."""
        if self.order == GIVEN:
            return "times"
        return "orders and times" if self.times == BEST else "orders"


@dataclass(frozen=True, eq=False)
class Report:
    """Results of one command.

    Parameters
    ----------
    objective : float
        Cost plus the price of the last time.
    evaluations : int
        Number of paths computed.
    begun, left_out, unfit : int
        Numbers of partial orders examined, of those left out because no trajectory was found, and of orders that do
        not fit the times.
    peak_m_s2 : float
        Largest control.
    """

    problem: MultipointProblem
    search: Search
    scene: Scene
    objective: float
    evaluations: int
    begun: int
    left_out: int
    unfit: int
    peak_m_s2: float


def report_json(report: Report) -> dict[str, object]:
    """Return the results for `experiments.common.output.to_json`."""
    problem, path = report.problem, report.scene.path
    hill = report.scene.axes is Axes.HILL
    return {
        **problem.head,
        "units": "m, s; " + ("x radial, y along the motion, z along the orbit's normal" if hill else "inertial axes"),
        "order_chosen": report.search.order,
        "times_chosen": report.search.times,
        "cost_m2_s3": path.cost,
        **({"cost_with_price_m2_s3": report.objective} if problem.price_per_s > 0.0 else {}),
        "order": report.scene.names,
        "times_s": path.nodes.arrive_s,
        "time_gradient_m2_s4": path.time_gradient,
        "nodes": [_node_json(report.scene, index) for index in range(len(report.scene.order))],
        "costate0": {"position_m_s3": path.costate_start[:3], "velocity_m_s2": path.costate_start[3:]},
        "peak_control_m_s2": report.peak_m_s2,
        "evaluations": report.evaluations,
        "orders_begun": report.begun,
        "orders_left_out": report.left_out,
        "orders_that_do_not_fit": report.unfit,
    }


def _node_json(scene: Scene, index: int) -> dict[str, object]:
    nodes, jump, state = scene.path.nodes, scene.path.jumps[index], scene.path.arrival_states[index]
    rendezvous = bool(nodes.rendezvous[index])
    return {
        "name": scene.names[index],
        "meet": "rendezvous" if rendezvous else "flyby",
        "position_m": state[:3],
        "velocity_m_s": state[3:],
        "target_velocity_m_s": nodes.arrive[index, 3:],
        "leave_s": nodes.leave_s[index],
        "jump_m_s3": jump[:3],
        **({"velocity_jump_m_s2": jump[3:]} if rendezvous else {}),
    }


def trajectories(scene: Scene) -> str:
    """Return the trajectories of the chaser and of the targets, as CSV; only the chaser has a control."""
    times, count = scene.times, len(scene.tour.targets.targets)
    chaser = np.column_stack([times, scene.path.state(times), scene.path.control(times)])
    tracks: list[tuple[list[Cell], Floats]] = [(["chaser"], chaser)]
    for target in range(count):
        states = scene.tour.targets.states(np.full(len(times), target), times)
        name = scene.tour.targets.targets[target].name
        tracks.append(([name], np.column_stack([times, states, np.full((len(times), 3), np.nan)])))
    return trajectories_csv(["craft"], ["time_s", *STATE_COLUMNS, *CONTROL_COLUMNS], tracks)


def report_parts(report: Report) -> Iterator[Part]:
    """Yield the cost, the visits and the extent of the search, for the screen."""
    path, nodes = report.scene.path, report.scene.path.nodes
    yield f"{report.problem.name}: cost I = {path.cost:.8g} m^2/s^3, peak |u| {report.peak_m_s2:.4g} m/s^2"
    unit, per_s = report.scene.time_unit
    table = number_table(
        "target", "meet", f"time\n{unit}", "relative speed\nm/s", "dI/dt\nm^2/s^4", "costate jump\nm/s^3", left=2
    )
    relative = np.linalg.norm(path.arrival_states[:, 3:] - nodes.arrive[:, 3:], axis=1)
    for index, name in enumerate(report.scene.names):
        rendezvous = bool(nodes.rendezvous[index])
        table.add_row(
            name,
            "rendezvous" if rendezvous else "flyby",
            f"{nodes.arrive_s[index] * per_s:.10g}",
            f"{0.0 if rendezvous else relative[index]:.5g}",
            f"{path.time_gradient[index]:.4g}",
            f"{np.linalg.norm(path.jumps[index, :3]):.4g}",
        )
    yield table
    if BEST not in (report.search.order, report.search.times):
        return
    text = f"{report.evaluations} paths computed"
    if report.search.order == BEST:
        text += f", {report.begun} partial orders examined"
        text += f", {report.left_out} left out because no trajectory was found" if report.left_out else ""
        text += f"; {report.unfit} orders do not fit the times" if report.unfit else ""
    yield text + ("; the times are a local minimum" if report.search.times == BEST else "")
