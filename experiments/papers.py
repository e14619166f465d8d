"""The papers' numbers beside ours: one module a paper, which computes with the library what the paper prints."""

from __future__ import annotations

from importlib import import_module

from experiments.common.published_number import Progress, Reproduction

PAPERS = ("interception", "pareto", "multipoint", "reachability", "pursuit")
"""Names, which are those of the modules too."""


def reproduce_paper(name: str, progress: Progress) -> Reproduction:
    """Compute the numbers of a paper.

    Parameters
    ----------
    name : str
        Of `PAPERS`.
    progress : callable
        Told the fraction done.

    Returns
    -------
    Reproduction
    """
    if name not in PAPERS:
        raise ValueError(f"there is no paper {name}")
    found = import_module(f"experiments.{name}.published").reproduce(progress)
    assert isinstance(found, Reproduction)
    return found
