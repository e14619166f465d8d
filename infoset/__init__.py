"""Set-membership estimation with polygon information sets: the set engine, usable on its own.

Start with `InformationSet` (a batch of sets carried through measurements, impulses and time), `LinearObserver` (the
same for a linear system of your own) or `ConvexPolygons` (operations on batches of convex polygons).
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

from infoset.engine.predicted_miss import ExtremePoints, PredictedMiss
from infoset.engine.set_state import SetStatus
from infoset.geometry.convex_polygons import ConvexPolygons
from infoset.geometry.zonotope import Zonotope
from infoset.information_set import InformationSet, InformationSetView
from infoset.model import InitialSet, Model, Recovery, SetModel, SetSettings, StateBox
from infoset.sensors import AngleSensor, BearingSensor, Bias, Camera, RangeSensor, RateSensor, Sensor
from infoset.set_queries import Section

if TYPE_CHECKING:
    from infoset.geometry.polytope import Polytope
    from infoset.observer.linear_observer import Estimate, Inconsistency, LinearObserver

_LATE = {
    **dict.fromkeys(("Estimate", "Inconsistency", "LinearObserver"), "infoset.observer.linear_observer"),
    "Polytope": "infoset.geometry.polytope",
}
"""Modules that import scipy, which takes longer than all others: imported when their names are used."""

__version__ = version("infoset")

__all__ = [
    "AngleSensor",
    "BearingSensor",
    "Bias",
    "Camera",
    "ConvexPolygons",
    "Estimate",
    "ExtremePoints",
    "Inconsistency",
    "InformationSet",
    "InformationSetView",
    "InitialSet",
    "LinearObserver",
    "Model",
    "Polytope",
    "PredictedMiss",
    "RangeSensor",
    "RateSensor",
    "Recovery",
    "Section",
    "Sensor",
    "SetModel",
    "SetSettings",
    "SetStatus",
    "StateBox",
    "Zonotope",
]


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> object:
    """Import a module of `_LATE` when its name is first used."""
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_LATE[name]), name)
