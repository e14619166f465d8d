"""A scraper for the gallery: figures that the library returns, which pyplot does not manage."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

DPI = 110


def library_figures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figure with the name `library_figure` of a block, once, and return the text that
    shows it.
    """
    figure = block_vars["example_globals"].pop("library_figure", None)
    if not isinstance(figure, Figure):
        return ""
    path = next(block_vars["image_path_iterator"])
    figure.savefig(path, dpi=DPI)
    return str(figure_rst([path], gallery_conf["src_dir"], "a figure of the library"))
