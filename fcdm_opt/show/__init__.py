"""Pictures: decision curves (`plots`) and the pair of bodies in space (`scene`)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's palette: told apart with any kind of colour vision, and in grey.
BLACK, BLUE, VERMILLION, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"
ORANGE, PURPLE, GREY = "#E69F00", "#CC79A7", "#7F7F7F"


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure (inches) on its own Agg canvas: no windows, no state shared between figures."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


SMALL, COLOURS = 100, 128  # dots per inch, and colours, of pictures for a README


def save(figure: Figure, path: str | Path, *, small: bool = False) -> tuple[Path, ...]:
    """Write a figure as PNG and SVG; the same figure gives the same bytes.

    Parameters
    ----------
    figure : matplotlib Figure
    path : path
        Without suffix; missing directories are made.
    small : bool
        Write a smaller PNG too, with "-small" after its name.

    Returns
    -------
    tuple of Path
        The PNG and the SVG file, and the small one.
    """
    from matplotlib import rc_context
    from PIL import Image

    base = Path(path)
    base.parent.mkdir(parents=True, exist_ok=True)
    png, svg = (base.with_name(f"{base.name}.{suffix}") for suffix in ("png", "svg"))
    # Text stays text in the SVG, so that labels can be searched; identifiers are hashed with a fixed salt.
    with rc_context({"svg.hashsalt": "fcdm_opt", "svg.fonttype": "none"}):
        figure.savefig(png, format="png", dpi=150, metadata={"Software": None})
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
        if not small:
            return png, svg
        less = base.with_name(f"{base.name}-small.png")
        figure.savefig(less, format="png", dpi=SMALL, metadata={"Software": None})
    with Image.open(less) as image:
        image.convert("RGB").quantize(COLOURS).save(less, optimize=True)
    return png, svg, less
