"""The style of figures, and the files of a figure."""

from __future__ import annotations

import pytest

from experiments.common import figure_style
from experiments.common.figure_style import WIDTH_MM, figure_bytes, legend_below, letters, style, subplots


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


def test_a_legend_has_each_label_once_and_panels_have_letters() -> None:
    with style():
        figure, (panels,) = subplots(40.0, 1, 2)
        for axes in panels:
            axes.plot([0.0, 1.0], [0.0, 1.0], label="line")
            axes.plot([0.0, 1.0], [1.0, 0.0])
        letters(panels, ["first"])
        legend_below(figure, 2)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["line"]
    assert [axes.get_title("left") for axes in panels] == ["(a) first", "(b)"]
