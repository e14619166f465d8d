"""Guidance with measurement errors that are bounded and have no known distribution.

Start with `load_scenario` and `simulate` (engagements), `InformationSet` (a batch of sets carried
through measurements, impulses and time), `LinearObserver` (the same for a linear system of your
own), or `Polytope` and `ConvexPolygons` (operations on sets). The packages `infoset.guidance`,
`infoset.sim`, `infoset.rendezvous` and `infoset.experiments` have further names. Each name is
loaded when it is first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from infoset import experiments as experiments
    from infoset import guidance as guidance
    from infoset import rendezvous as rendezvous
    from infoset import sim as sim
    from infoset.engine.predicted_miss import ExtremePoints, PredictedMiss
    from infoset.engine.set_state import SetStatus
    from infoset.experiments import (
        InputError,
        load_problem,
        load_record,
        load_results,
        load_scenario,
        plot,
        save,
    )
    from infoset.geometry.convex_polygons import ConvexPolygons
    from infoset.geometry.polytope import Polytope
    from infoset.geometry.zonotope import Zonotope
    from infoset.information_set import InformationSet, InformationSetView
    from infoset.model import InitialSet, Model, Recovery, SetModel, SetSettings, StateBox
    from infoset.observer.cover import Detection
    from infoset.observer.estimate import Estimate, Inconsistency
    from infoset.observer.linear_observer import LinearObserver
    from infoset.sensors import (
        AngleSensor,
        BearingSensor,
        Bias,
        Brightness,
        Camera,
        RangeSensor,
        RateSensor,
        Sensor,
    )
    from infoset.sensors.jitter import Jitter, jitter
    from infoset.set_queries import Section
    from infoset.sim import GuaranteeWarning, find_worst, fly_one, lower_bound, simulate

    __version__: str

PACKAGES = ("experiments", "guidance", "rendezvous", "sim")
"""Packages inside this one. In a checkout their folders are beside the folder of this one."""

_MODULES = {
    "infoset.engine.predicted_miss": ("ExtremePoints", "PredictedMiss"),
    "infoset.engine.set_state": ("SetStatus",),
    "infoset.experiments": (
        "InputError",
        "load_problem",
        "load_record",
        "load_results",
        "load_scenario",
        "plot",
        "save",
    ),
    "infoset.geometry.convex_polygons": ("ConvexPolygons",),
    "infoset.geometry.polytope": ("Polytope",),
    "infoset.geometry.zonotope": ("Zonotope",),
    "infoset.information_set": ("InformationSet", "InformationSetView"),
    "infoset.model": ("InitialSet", "Model", "Recovery", "SetModel", "SetSettings", "StateBox"),
    "infoset.observer.cover": ("Detection",),
    "infoset.observer.estimate": ("Estimate", "Inconsistency"),
    "infoset.observer.linear_observer": ("LinearObserver",),
    "infoset.sensors": (
        "AngleSensor",
        "BearingSensor",
        "Bias",
        "Brightness",
        "Camera",
        "RangeSensor",
        "RateSensor",
        "Sensor",
    ),
    "infoset.sensors.jitter": ("Jitter", "jitter"),
    "infoset.set_queries": ("Section",),
    "infoset.sim": ("GuaranteeWarning", "find_worst", "fly_one", "lower_bound", "simulate"),
}
"""Public names by the module that defines them."""

__all__ = [
    "AngleSensor",
    "BearingSensor",
    "Bias",
    "Brightness",
    "Camera",
    "ConvexPolygons",
    "Detection",
    "Estimate",
    "ExtremePoints",
    "GuaranteeWarning",
    "Inconsistency",
    "InformationSet",
    "InformationSetView",
    "InitialSet",
    "InputError",
    "Jitter",
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
    "find_worst",
    "fly_one",
    "jitter",
    "load_problem",
    "load_record",
    "load_results",
    "load_scenario",
    "lower_bound",
    "plot",
    "save",
    "simulate",
]


class CheckoutFinder:
    """Find the packages inside this one where their folders are beside its folder.

    Python's own search looks for `infoset.sim` in the folder ``infoset``, where an installation has
    it.
    """

    @classmethod
    def find_spec(
        cls, name: str, _path: object = None, _target: object = None
    ) -> ModuleSpec | None:
        """Return the location of a package; None for all other names."""
        parent, _, package = name.rpartition(".")
        if parent != __name__ or package not in PACKAGES:
            return None
        root = Path(__file__).resolve().parents[1]
        return PathFinder.find_spec(name, [str(root)])


_IS_CHECKOUT = not (Path(__file__).parent / "sim").is_dir()
if _IS_CHECKOUT:
    sys.meta_path.append(CheckoutFinder)


def __dir__() -> list[str]:
    return sorted([*__all__, *PACKAGES, "__version__"])


if not TYPE_CHECKING:  # so that type checkers report a name that does not exist

    def __getattr__(name: str) -> object:
        """Load a public name or a package when it is first used."""
        if name == "__version__":
            from importlib.metadata import version

            return version(__name__)
        if name in PACKAGES:
            return import_module(f"{__name__}.{name}")
        for module, names in _MODULES.items():
            if name in names:
                return getattr(import_module(module), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
