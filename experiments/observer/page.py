"""Page of an observer: the set of each step, and the bounds of the states against time."""

from __future__ import annotations

from importlib import resources

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.page_document import page
from infoset.experiments.observer.report import (
    ObserverReport,
    outlines,
    shown_bounds,
    times,
    wrong_text,
)
from infoset.observer.estimate import MAX_POLYTOPE_STATES, Estimate


def _centre(estimate: Estimate) -> Floats | None:
    """Return the centre of a largest ball in a set.

    None if the set is empty or of too many states for known facets, or if the possible states are
    in several sets.
    """
    if estimate.is_empty or estimate.states > MAX_POLYTOPE_STATES or estimate.members > 1:
        return None
    return estimate.chebyshev_centre()


def observer_page(report: ObserverReport) -> str:
    """Return the page as HTML."""
    problem = report.problem
    about = [problem.description] if problem.description else []
    about.append(
        f"{len(report.estimates)} steps; {report.data.origin}. Step with the arrow keys or the "
        "slider."
    )
    empty_from = None
    if report.contradicted:
        empty_from = int(np.argmax([estimate.is_empty for estimate in report.estimates]))
        about.append(
            f"The measurements contradict the model at step {int(report.inconsistency.step)}."
        )

    if report.allows_wrong:
        text = wrong_text(report)
        about.append(f"{text[0].upper()}{text[1:]}.")

    time, title = times(report)
    content = {
        "heading": f"Possible states of {problem.name}",
        "about": about,
        "names": problem.names,
        "time": time,
        "time_title": title,
        "empty_from": empty_from,
        "proved_at": int(report.detection.step) if report.proved else None,
        "steps": _steps(report),
    }
    script = (resources.files("infoset.experiments.observer") / "page.js").read_text(
        encoding="utf-8"
    )
    return page(f"Observer {problem.name}", [], content, script)


def _steps(report: ObserverReport) -> list[dict[str, object]]:
    """Return the values of each step, with all keys in each; null or empty if not known."""
    data = report.data
    bounds = shown_bounds(report.estimates)
    smoothed_bounds = None if report.smoothed is None else shown_bounds(report.smoothed)
    steps: list[dict[str, object]] = []
    for index, estimate in enumerate(report.estimates):
        values: dict[str, object] = {
            "k": estimate.step,
            "lower": None,
            "upper": None,
            "later": None,
            "centre": _centre(estimate),
            "sets": [],
            "smoothed": [],
            "measured": [
                None if np.isnan(value) else value for value in data.measured[index].tolist()
            ],
            "inputs": data.inputs[index],
            "state": None if data.states is None else data.states[index],
        }
        if not estimate.is_empty:
            values["lower"], values["upper"] = bounds[index]
        if smoothed_bounds is not None and not np.isnan(smoothed_bounds[index]).any():
            values["later"] = smoothed_bounds[index]
        if estimate.states == 2:
            values["sets"] = outlines(estimate)
            if report.smoothed is not None:
                values["smoothed"] = outlines(report.smoothed[index])
        steps.append(values)
    return steps
