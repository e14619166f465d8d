"""Set-membership estimation with polygon information sets: the set engine, usable on its own.

Start with `InformationSet` (a batch of sets carried through measurements, impulses and time) or
`ConvexPolygons` (operations on batches of convex polygons).
"""

from importlib.metadata import version

from infoset.convex_polygons import ConvexPolygons
from infoset.information_set import InformationSet, InformationSetView
from infoset.model import InitialSet, Model, Recovery, SetModel, StateBox
from infoset.predicted_miss import ExtremePoints, PredictedMiss
from infoset.sensors import AngleSensor, Bias, Convention, ErrorShape, RangeSensor, RateSensor, Sensor
from infoset.set_queries import Section, to_omega_alpha
from infoset.set_state import SetStatus
from infoset.shapes import from_shapely, to_shapely

__version__ = version("infoset")

__all__ = [
    "AngleSensor",
    "Bias",
    "Convention",
    "ConvexPolygons",
    "ErrorShape",
    "ExtremePoints",
    "InformationSet",
    "InformationSetView",
    "InitialSet",
    "Model",
    "PredictedMiss",
    "RangeSensor",
    "RateSensor",
    "Recovery",
    "Section",
    "Sensor",
    "SetModel",
    "SetStatus",
    "StateBox",
    "from_shapely",
    "to_omega_alpha",
    "to_shapely",
]
