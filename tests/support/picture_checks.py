"""What every picture must keep to: no text off the page, none upon another, none too small to read in print."""

from __future__ import annotations

from itertools import combinations
from typing import Any

from matplotlib.text import Text

LEAST_SIZE = 6.0
"""Points, at the width of the page that pictures are drawn for."""


def shown(figure: Any) -> list[Text]:
    """Return the texts that are drawn: of ticks only those inside the axes."""
    figure.draw_without_rendering()
    hidden = set()
    for axes in figure.axes:
        for axis, limits in ((axes.xaxis, sorted(axes.get_xlim())), (axes.yaxis, sorted(axes.get_ylim()))):
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            room = 1e-9 * (limits[1] - limits[0])
            off = [t for t in ticks if not limits[0] - room <= t.get_loc() <= limits[1] + room or not axes.axison]
            hidden |= {label for tick in off for label in (tick.label1, tick.label2)}
            if not axes.axison:
                hidden |= {axis.label, axis.offsetText}
    found = dict.fromkeys(figure.findobj(Text))
    return [text for text in found if text.get_visible() and text.get_text().strip() and text not in hidden]


def check_texts(figure: Any, *, least: int = 4) -> None:
    """Assert that a figure's texts are on the page, apart, and large enough; that there are some."""
    texts = shown(figure)
    assert len(texts) >= least
    boxes = {text: Text.get_window_extent(text) for text in texts}
    frames = {text: patch.get_window_extent() for text in texts if (patch := text.get_bbox_patch())}
    for text, box in [*boxes.items(), *frames.items()]:
        assert text.get_fontsize() >= LEAST_SIZE, text.get_text()
        assert 0 <= box.x0 <= box.x1 <= figure.bbox.x1, text.get_text()
        assert 0 <= box.y0 <= box.y1 <= figure.bbox.y1, text.get_text()
    for (one, own), (two, other) in combinations(boxes.items(), 2):
        assert not own.overlaps(other), (one.get_text(), two.get_text())
