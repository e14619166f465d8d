"""Whether the texts of a figure have room."""

from __future__ import annotations

import itertools

from matplotlib.figure import Figure


def need_room(figure: Figure) -> None:
    """Check that no tick labels, titles, labels of axes and legends of a figure touch, and that all are inside it."""
    figure.draw_without_rendering()
    texts = []
    for axes in figure.axes:
        for one in (axes.xaxis, axes.yaxis):
            low, high = sorted(one.get_view_interval())
            ticks = [tick for tick in one.get_major_ticks() if low <= tick.get_loc() <= high]
            labels = [label for tick in ticks for label in (tick.label1, tick.label2)]
            shown = [label for label in labels if label.get_visible() and label.get_text()]
            assert len(shown) >= 2 or not (one.label.get_visible() and one.get_label_text()), one.get_label_text()
            texts += shown
        texts += [text for text in (axes.title, axes.xaxis.label, axes.yaxis.label) if text.get_text()]
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts]
    boxes += [("legend", legend.get_window_extent()) for legend in figure.legends]
    touching = [(one, other) for (one, a), (other, b) in itertools.combinations(boxes, 2) if a.overlaps(b)]
    assert not touching, touching
    page = figure.bbox
    outside = [text for text, box in boxes if box.x0 < 0 or box.y0 < 0 or box.x1 > page.x1 or box.y1 > page.y1]
    assert not outside, outside
