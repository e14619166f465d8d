"""The style of figures, and the files of a figure."""

from __future__ import annotations

import pytest

from experiments.common import figure_style
from experiments.common.figure_style import WIDTH_MM, figure_bytes, legend_below, style, subplots


def test_pdfs_have_truetype_fonts_and_pngs_200_dpi(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figure_style, "STYLE", figure_style.STYLE[:1])
    with style():
        figure, ((axes,),) = subplots(40.0)
        axes.set_xlabel("ν² of $\\Phi_0$, −1 to 1 µm")
        files = dict(figure_bytes(figure))
    assert files["pdf"].count(b"/FontFile2") == 2
    assert b"/Type3" not in files["pdf"]
    # The header of a PNG has its width at byte 16.
    assert int.from_bytes(files["png"][16:20], "big") == int(WIDTH_MM / 25.4 * 200.0)


@style()
def test_a_legend_is_not_wider_than_its_figure() -> None:
    figure, ((axes,),) = subplots(40.0)
    for number in range(6):
        axes.plot([0.0, 1.0], [0.0, number], label=f"{number}: {'long ' * 8}")
    legend_below(figure, 3)
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 6
    assert legend.get_window_extent().width <= figure.bbox.width
