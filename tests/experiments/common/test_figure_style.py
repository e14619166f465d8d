"""Labels of figures stand apart from each other, from the marks and from the lines."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from experiments.common import figure_style
from experiments.common.figure_style import figure_bytes, figure_grid, place_labels, style


@pytest.mark.parametrize("centred", [False, True])
def test_labels_of_nested_outlines_do_not_touch_and_stay_inside_the_axes(centred: bool) -> None:
    figure, (axes,) = figure_grid(80.0, 1, 1, (14.0, 4.0, 12.0, 7.0), (0.0, 0.0))
    turn = np.linspace(0.0, 2.0 * np.pi, 97)[:-1]
    # All outlines have the same top, where all labels would stand.
    circles = [radius * np.column_stack([np.cos(turn), np.sin(turn)]) - [0.0, radius] for radius in np.arange(1.0, 7.0)]
    for circle in circles:
        axes.plot(*circle.T)
    labels = [
        (
            f"t = {number}",
            circle[np.argsort(-circle[:, 1])[::4]],
            np.vstack([*circles[:number], *circles[number + 1 :]]),
        )
        for number, circle in enumerate(circles)
    ]
    place_labels(axes, labels, np.zeros((1, 2)), centred=centred)
    boxes = [text.get_window_extent() for text in axes.texts]
    frame = axes.get_window_extent()
    assert len(boxes) == 6
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1 for box in boxes)
    mark = axes.transData.transform((0.0, 0.0))
    assert not any(box.contains(*mark) for box in boxes)
    if centred:
        for text, circle in zip(axes.texts, circles, strict=True):
            box = text.get_window_extent()
            assert any(box.contains(*point) for point in axes.transData.transform(circle))
    figure.clear()


def test_pdfs_have_truetype_fonts_and_pngs_200_dpi(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figure_style, "STYLE", figure_style.STYLE[:1])
    with style():
        figure, (axes,) = figure_grid(40.0, 1, 1, (10.0, 5.0, 10.0, 5.0), (0.0, 0.0))
        axes.set_xlabel("ν² of $\\Phi_0$, −1 to 1 µm")
        files = dict(figure_bytes(figure))
    assert files["pdf"].count(b"/FontFile2") == 2
    assert b"/Type3" not in files["pdf"]
    # The header of a PNG has its width at byte 16.
    assert int.from_bytes(files["png"][16:20], "big") == int(180.0 / 25.4 * 200.0)
