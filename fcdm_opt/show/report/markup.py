"""Pages that are one file: templates filled with plain data, with scripts, what these draw, and plotly.js inside."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Sequence
from functools import cache
from typing import Any

from fcdm_opt.errors import InputError
from fcdm_opt.show.rendering import rendered, source


def packed(text: str) -> str:
    """Return gzip + base64 of a text; the same text gives the same characters."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


@cache
def _plotly() -> str:
    """Return the source of plotly.js."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as reason:
        what = f"plotly cannot be loaded ({reason}), whose script draws the figures; install it with pip install plotly"
        raise InputError(what, key="report") from reason
    return get_plotlyjs()


@cache
def embedded_plotly() -> str:
    """Return plotly.js as `packed` gives it; raises `InputError` where it is not installed."""
    return packed(_plotly())


def whole_page(template: str, *, scripts: Sequence[str], figures: Any, **data: Any) -> str:
    """Return a page that is one file, with plotly.js, scripts and what they draw inside it.

    Parameters
    ----------
    template : str
        That extends "frame.html".
    scripts : sequence of str
        Files beside the templates, joined in this order after "common.js".
    figures : plain data
        What the scripts read, as `JSON.parse` gives it.
    **data
        Plain data for the template.
    """
    plotly = _plotly()
    return rendered(
        template,
        **data,
        css=source("page.css"),
        js="\n".join(map(source, ("common.js", *scripts))),
        notice=plotly[plotly.index("/*") + 2 : plotly.index("*/")].replace("--", "- -"),
        plotly=embedded_plotly(),
        figures=packed(json.dumps(figures, allow_nan=False, separators=(",", ":"))),
    )
