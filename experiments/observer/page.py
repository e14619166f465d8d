"""Page of an observer: the set of each step, and the bounds of the states against time."""

from __future__ import annotations

from importlib import resources

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.page_document import page
from infoset.experiments.observer.report import ObserverReport, shown_bounds, times
from infoset.observer.linear_observer import MAX_POLYTOPE_STATES, Estimate


def _centre(estimate: Estimate) -> Floats | None:
    """Return the centre of a largest ball in a set; None if it is empty, or its facets are not
    known.
    """
    if estimate.is_empty or estimate.states > MAX_POLYTOPE_STATES:
        return None
    return estimate.chebyshev_centre()


def observer_page(report: ObserverReport) -> str:
    """Return the page as HTML."""
    time, title = times(report)
    problem = report.problem
    data = report.data
    about = [problem.description] if problem.description else []
    about.append(
        f"{len(report.estimates)} steps; {data.origin}. Step with the arrow keys or the slider."
    )
    if report.contradicted:
        about.append(
            f"The measurements contradict the model at step {int(report.inconsistency.step)}."
        )
    bounds = shown_bounds(report.estimates)
    later = None if report.smoothed is None else shown_bounds(report.smoothed)
    content = {
        "heading": f"Possible states of {problem.name}",
        "about": about,
        "names": problem.names,
        "time": time,
        "time_title": title,
        "empty_from": int(np.argmax([estimate.is_empty for estimate in report.estimates]))
        if report.contradicted
        else None,
        "steps": [
            {
                "k": estimate.step,
                "lower": None if estimate.is_empty else bounds[index, 0],
                "upper": None if estimate.is_empty else bounds[index, 1],
                "later": None if later is None or np.isnan(later[index]).any() else later[index],
                "centre": _centre(estimate),
                "vertices": estimate.polygons.polygon() if estimate.states == 2 else [],
                "smoothed": []
                if report.smoothed is None or estimate.states != 2
                else report.smoothed[index].polygons.polygon(),
                "measured": [
                    None if np.isnan(value) else value for value in data.measured[index].tolist()
                ],
                "inputs": data.inputs[index],
                "state": None if data.states is None else data.states[index],
            }
            for index, estimate in enumerate(report.estimates)
        ],
    }
    script = (resources.files("infoset.experiments.observer") / "page.js").read_text(
        encoding="utf-8"
    )
    return page(f"Observer {problem.name}", [], content, script)
