"""What is shown: pictures for print and screen, tables on a terminal, cards of notebooks, and reports.

texts            numbers, questions and answers in words, for all of these; `verdict` and `remarks` are sentences
glossary         words of this package, each in a line
rendering        HTML from `templates`, for `cards` and `report`
cards            what notebooks show
solved           cases as tables and reports show them
tables           what the command line prints, by `printing`
assemblies       tables and pictures of several parts

Pictures, and here what they share:

plots            decision curves, before and after a motion and over a coherent range; the plane of scales
scene            the pair of bodies in space; `raster` hides and shades, `sections` cut contacts open
maps             compensation maps, and the yield of a fit; `grids` are these maps for the shop floor
studies          the amount over what a study varied
sensitivities    what the amount depends on
lettering        words on a picture, none upon another
album            all of them, written to a directory
"""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from collections.abc import Callable
from functools import wraps
from io import BytesIO, StringIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, ParamSpec, TypeVar

from fcdm_opt.lazy_import import extra

if TYPE_CHECKING:
    from matplotlib.figure import Figure
else:
    Figure = Any  # matplotlib is imported when something is drawn

# Okabe and Ito's palette: told apart with any kind of colour vision, and in grey.
BLACK, BLUE, VERMILLION, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"
ORANGE, PURPLE, GREY = "#E69F00", "#CC79A7", "#7F7F7F"
DARK = "#595959"
"""Grey of words: 7 to 1 on white, as legible text needs."""

LINE = "#1A1A1A"
"""Of edges on bodies, dark in any colour scheme: a surface is light, whatever the page is."""

PAGE = 17.0 / 2.54  # width in inches at which pictures are printed, across a page; sizes of text hold at it
TITLE, TEXT, NOTE = 9.0, 7.5, 6.5  # sizes of text in points: titles, labels, and lists beside a picture
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same on every machine
    "figure.titlesize": TITLE,
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize"), TEXT),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), NOTE),
    **dict.fromkeys(("legend.frameon", "axes.formatter.useoffset"), False),
    "axes.axisbelow": True,
    "grid.color": GREY,
    "grid.alpha": 0.2,
    "lines.linewidth": 1.3,
    **dict.fromkeys(("axes.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
    **dict.fromkeys(("grid.linewidth", "hatch.linewidth"), 0.5),
    **dict.fromkeys(("xtick.major.size", "ytick.major.size"), 2.5),
    **dict.fromkeys(("xtick.minor.size", "ytick.minor.size"), 1.5),
}


P = ParamSpec("P")
T = TypeVar("T")


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Let a function that draws a figure do so in the style of all pictures; global settings stay as they are."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        with extra("matplotlib", "pictures").rc_context(STYLE):
            return draw(*args, **kwargs)

    return drawn


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure (inches) on its own Agg canvas: no windows, no state shared between figures."""
    figure: Figure = extra("matplotlib.figure", "pictures").Figure(figsize=(width, height))
    extra("matplotlib.backends.backend_agg", "pictures").FigureCanvasAgg(figure)
    return figure


DOTS, SMALL, COLOURS = 300, 1000, 256
"""Dots per inch in print, where a wider picture is reduced to the page; pixels across and colours for a README."""

DARKEST = (20, 215)  # lightness of white on a dark page, and by how much black is lighter, of 255


def write_svg(figure: Figure, to: Path | IO[str]) -> None:
    """Write a figure as SVG. Text stays text, so that labels can be searched; identifiers have a fixed salt."""
    from matplotlib import rc_context

    with rc_context({"svg.hashsalt": "fcdm_opt", "svg.fonttype": "none"}):
        figure.savefig(to, format="svg", metadata={"Date": None, "Creator": None})


def in_dark(image: Any) -> Any:
    """Return a picture for a dark page: light on dark in the same hues, as transparent as it is."""
    from PIL import Image

    light, *hues = image.convert("RGB").convert("YCbCr").split()
    turned = light.point([DARKEST[0] + (255 - k) * DARKEST[1] // 255 for k in range(256)])
    shown = Image.merge("YCbCr", (turned, *hues)).convert("RGB")
    if image.mode == "RGBA":
        shown.putalpha(image.getchannel("A"))
    return shown


def _svg_in_dark(svg: str) -> str:
    """Return an SVG for a dark page: its colours, the black that is not written, and the pictures in it."""
    from PIL import Image

    def colour(found: re.Match[str]) -> str:
        return "#{:02x}{:02x}{:02x}".format(*in_dark(Image.new("RGB", (1, 1), found[0])).getpixel((0, 0)))

    def picture(found: re.Match[str]) -> str:
        made = BytesIO()
        in_dark(Image.open(BytesIO(b64decode(found[1])))).save(made, format="png")
        return f"data:image/png;base64,{b64encode(made.getvalue()).decode()}"

    svg = re.sub(r"#[0-9a-fA-F]{6}\b", colour, svg.replace("<svg ", '<svg fill="#000000" ', 1))
    return re.sub(r"data:image/png;base64,([A-Za-z0-9+/=\s]+)", picture, svg)


INKS = {
    BLACK: "ink", DARK: "quiet", GREY: "muted", BLUE: "movable", VERMILLION: "static", GREEN: "good",
    "#FFFFFF": "paper",
}  # fmt: skip
"""Colours that follow the colour scheme of a page, and the variable of its style that each is."""


def inline_svg(figure: Figure, name: str) -> str:
    """Return a figure as SVG to stand in a page: in its colours, without ground; a name begins all identifiers."""
    text = StringIO()
    figure.patch.set_visible(False)
    write_svg(figure, text)
    svg = text.getvalue()
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    used = set(re.findall(r"(?:url\(#|href=\"#)([^)\"]+)", svg))
    svg = re.sub(r' id="([^"]*)"', lambda own: f' id="{name}-{own[1]}"' if own[1] in used else "", svg)
    svg = re.sub(r'(url\(#|href="#)', rf"\g<1>{name}-", svg)
    return in_scheme(svg)


def in_scheme(text: str) -> str:
    """Return a text of a page with the colours in it that follow its colour scheme."""
    return re.sub("|".join(INKS), lambda own: f"var(--{INKS[own[0].upper()]})", text, flags=re.IGNORECASE)


MIDDLE = "#7B7B7B"
"""Grey of words and lines that stand out on a light page and on a dark one alike, 4 to 1."""


def bare_pixels(figure: Figure, *, across: int) -> bytes:
    """Return a figure as PNG without ground, its words and axes in a grey for light and for dark pages."""
    from matplotlib.colors import to_hex
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.spines import Spine
    from matplotlib.text import Text

    drawn: Any = figure.findobj(lambda own: isinstance(own, Text | Line2D | Spine | FancyArrowPatch))
    for own in drawn:
        colour = own.get_edgecolor() if isinstance(own, Spine | FancyArrowPatch) else own.get_color()
        grounded = isinstance(own, Text) and own.get_bbox_patch() is not None
        if to_hex(colour).upper() in (BLACK, DARK) and not grounded:
            own.set_color(MIDDLE)
    for axes in figure.axes:
        axes.patch.set_visible(False)
        axes.tick_params(which="both", color=MIDDLE)
    whole = BytesIO()
    dots = across / figure.get_figwidth()
    figure.savefig(whole, format="png", dpi=dots, transparent=True, metadata={"Software": None})
    return whole.getvalue()


def pixels(figure: Figure, *, across: int = SMALL, dark: bool = False) -> bytes:
    """Return a figure as a small PNG, so many pixels across, in few colours; the same figure gives the same bytes.

    `dark`: for a dark page, light on dark in the same hues.
    """
    from PIL import Image

    whole, small = BytesIO(), BytesIO()
    figure.savefig(whole, format="png", dpi=across / figure.get_figwidth(), metadata={"Software": None})
    with Image.open(whole) as image:
        shown = in_dark(image) if dark else image
        shown.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE).save(small, format="png", optimize=True)
    return small.getvalue()


def save(figure: Figure, path: str | Path, *, small: bool = False, dark: bool = False) -> tuple[Path, ...]:
    """Write a figure as PNG and SVG, and return both paths; the same figure gives the same bytes.

    The path is without suffix; missing directories are made. With `small` there are smaller PNGs too, with "-small"
    after the name, and "-small-dark" for dark pages; their paths follow. With `dark` both are light on dark.
    """
    base = Path(path)
    base.parent.mkdir(parents=True, exist_ok=True)
    png, svg = (base.with_name(f"{base.name}.{suffix}") for suffix in ("png", "svg"))
    dots = DOTS * min(1.0, PAGE / figure.get_figwidth())
    figure.savefig(png, format="png", dpi=dots, metadata={"Software": None})
    write_svg(figure, svg)
    if dark:
        from PIL import Image

        with Image.open(png) as image:
            in_dark(image).save(png, format="png", dpi=(dots, dots))
        svg.write_text(_svg_in_dark(svg.read_text(encoding="utf-8")), encoding="utf-8")
    if not small:
        return png, svg
    less = base.with_name(f"{base.name}-small.png"), base.with_name(f"{base.name}-small-dark.png")
    for one, dark in zip(less, (False, True), strict=True):
        one.write_bytes(pixels(figure, dark=dark))
    return png, svg, *less
