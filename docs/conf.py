"""Configuration of the documentation; CONTRIBUTING.md has the command. Nothing is loaded from the
network.
"""

from __future__ import annotations

import os
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType

from numpydoc import xref
from sphinx.application import Sphinx

import infoset
from infoset import guidance, sim
from infoset.geometry import polytope
from infoset.rendezvous import multipoint, pareto, pursuit_evasion, reachability, relative_motion

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_extensions"))

# Gallery examples draw into files, also on machines without a screen.
os.environ.setdefault("MPLBACKEND", "agg")

_project = tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
project = "infoset"
author = "the infoset authors"
release = version = _project["version"]
language = "en"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "command_help",
    "mathml",
]
html_math_renderer = "mathml"
exclude_patterns = [
    "_build",
    "_extensions",
    "examples",
    "gallery/*.py",
    "gallery/*.ipynb",
    "**/sg_execution_times.rst",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = True
# Types of other projects are named and not linked: links would need their inventories from the
# network.
nitpick_ignore_regex = [
    (
        "py:.*",
        r"(numpy|np|os|shapely|pyarrow|matplotlib|concurrent|collections|pathlib|enum|types|typing)\..*",
    ),
    (
        "py:.*",
        r"(ArrayLike|NDArray|Floats|Flags|Integers|Places|Interval|RangeOrRanges|Callable|Sequence|Iterator|Mapping|Executor|Path"
        r"|Frozen|BaseGeometry|MaskedArray)",
    ),
]

# Types that functions return and users do not construct: named without a description.
nitpick_ignore = [
    ("py:class", f"{module}.{name}")
    for module, names in {
        "infoset.experiments.multipoint.file": ("MultipointProblem",),
        "infoset.experiments.observer.file": ("ObserverProblem",),
        "infoset.experiments.pareto.file": ("ParetoProblem",),
        "infoset.experiments.pursuit.file": ("PursuitProblem",),
        "infoset.experiments.reachability.file": ("Rendezvous",),
        "infoset.experiments.reachability.system_file": ("ReachableSystem",),
        "infoset.geometry.polytope.polyhedron": ("Polyhedron",),
        "infoset.geometry.zonotope_arrays": ("ZonotopeArrays",),
        "infoset.guidance.predictive": ("ManoeuvreState",),
        "infoset.guidance.thruster": ("FloatOrFloats",),
        "infoset.guidance.proportional_navigation": ("PulseState",),
        "infoset.geometry.convex_polygons": ("PolygonsOrPolytope",),
        "infoset.geometry.convex_set": ("ConvexSet",),
        "infoset.geometry.polytope.nearest": ("NearestPair",),
        "infoset.sim.scenario": ("_Speed",),
        "infoset.observer.sets": ("Polygons", "Polytopes", "Sets", "Motion"),
        "infoset.observer.steps": ("Strips",),
        "infoset.rendezvous.relative_motion.linear_motion": ("HeldSegment",),
        "infoset.limits": ("Line",),
        "infoset.sensors.sensor": ("Measurements", "Geometry", "Apart", "Cuttable"),
        "infoset.sensors.bearing": ("RangeOrRanges",),
        "infoset.set_queries": ("SetQueries",),
        "infoset.engine.set_state": ("SetState",),
        "infoset.rendezvous.multipoint._shooting": ("ShotPath",),
        "infoset.rendezvous.multipoint.segments": ("LinearPath",),
        "infoset.sim.covariance": ("Covariance",),
        "infoset.sim.engagement": ("Step",),
        "infoset.rendezvous.pursuit_evasion._pair": ("Node",),
        "infoset.rendezvous.pursuit_evasion.paths": ("SteeredPath",),
        "infoset.rendezvous.reachability.line_of_sight": ("SightRows",),
        "infoset.rendezvous.reachability.sets": ("ExactSets", "LiftedSets"),
        "infoset.rendezvous.reachability.problem": ("StateBlock",),
        "infoset.rendezvous.reachability.admissible": ("Lifted",),
        "infoset.rendezvous.reachability.optimum": ("BlockOptimum",),
        "infoset.sim.bound.pair_of_motions": ("TruthPair",),
        "infoset.sim.parallel": ("Task",),
        "infoset.sim.storage.campaign_folder": ("CampaignFolder",),
        "infoset.sim.storage.manifest": ("Manifest",),
    }.items()
    for name in names
]
nitpick_ignore.append(("py:class", "0.0"))  # the limit in the type of a speed

# --- text
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
# Displayed formulas are fenced blocks: hosts of repositories render those without losing
# backslashes.
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3
myst_links_external_new_tab = False

# --- the reference
autodoc_default_options = {"members": True}
autodoc_member_order = "groupwise"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
maximum_signature_line_length = 100
add_module_names = False
toc_object_entries_show_parents = "hide"
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
# Without this numpydoc links int, str and array_like to pages of Python and NumPy.
xref.DEFAULT_LINKS.clear()


def _public(*packages: ModuleType) -> dict[str, str]:
    """Return where the type names in docstrings are described; names that occur in two packages are
    left out.
    """
    homes: dict[str, list[str]] = {}
    for package in packages:
        for name in package.__all__:
            if isinstance(getattr(package, name), type):
                homes.setdefault(name, []).append(f"{package.__name__}.{name}")
    return {name: found[0] for name, found in homes.items() if len(found) == 1}


numpydoc_xref_aliases = _public(
    infoset,
    guidance,
    sim,
    multipoint,
    pareto,
    polytope,
    pursuit_evasion,
    reachability,
    relative_motion,
)

# Docstrings are plain text with |moduli| and `names`; reStructuredText reads the first as
# substitutions.
default_role = "code"


def _keep_moduli(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    lines[:] = [
        line if line.lstrip().startswith(">>>") else line.replace("|", r"\|") for line in lines
    ]


_ARRAY = re.compile(
    r"~?numpy\.ndarray\[tuple\[~?(?:typing\.)?Any, \.\.\.\], ~?numpy\.dtype\[[^\[\]]*\]\]"
)


_LIMITED = re.compile(
    r"~?(?:typing\.)?Annotated\[((?:[^\[\]]|\[[^\[\]]*\])*?), ~?[\w.]*Limits\([^()]*\)\]"
)


def _plain_types(
    app: Sphinx,
    what: str,
    name: str,
    thing: object,
    options: object,
    signature: str | None,
    returned: str | None,
) -> tuple[str | None, str | None]:
    """Write `ndarray` and `float` instead of full types: the docstring has shapes, units and
    limits.
    """
    plain = [
        None if text is None else _LIMITED.sub(r"\1", _ARRAY.sub("numpy.ndarray", text))
        for text in (signature, returned)
    ]
    return plain[0], plain[1]


def setup(app: Sphinx) -> None:
    """Register the changes of docstrings and signatures; the first runs before numpydoc."""
    app.connect("autodoc-process-docstring", _keep_moduli, priority=100)
    app.connect("autodoc-process-signature", _plain_types, priority=900)


# --- figures computed during the build
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": "/",
    "only_warn_on_example_error": False,
    "abort_on_example_error": True,
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "plot_gallery": "True",
    "image_scrapers": ("matplotlib", "library_figures.library_figures"),
    "within_subsection_order": "FileNameSortKey",
    "default_thumb_file": None,
    "write_computation_times": False,
}

# --- pages
html_theme = "pydata_sphinx_theme"
html_title = "infoset"
html_context = {"default_mode": "auto"}
html_static_path = ["_static"]
html_css_files = ["infoset.css"]
# Pages without a sidebar.
html_sidebars = {"index": [], "start": [], "glossary": []}
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "header_links_before_dropdown": 7,
    "navbar_start": ["navbar-logo"],
    "navbar_end": ["theme-switcher"],
    "navbar_persistent": ["search-button"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
copyright = "the infoset authors; MIT licence"  # noqa: A001
