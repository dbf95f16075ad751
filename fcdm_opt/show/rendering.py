"""Texts from the folder `templates`: in HTML all is escaped wherever it stands, and equal data give equal bytes."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Sequence
from functools import cache
from typing import Any

from fcdm_opt.geometry.units import NANOMETRES, measured, signed
from fcdm_opt.lazy_import import extra
from fcdm_opt.show.glossary import EXPLAINED
from fcdm_opt.show.texts import NONE, numbers, shown

LONGEST = 160  # characters of a text that a card shows; faces with hundreds of corners have labels of thousands
UNMEASURED = (NONE, "impossible")  # texts that stand for a number and take no unit


def rendered(template: str, **data: Any) -> str:
    """Return a template of this package filled with plain data; a name that is not there is an error."""
    return environment().get_template(template).render(**data)


def whole_page(template: str, *, scripts: Sequence[str] = (), figures: Any = None, **data: Any) -> str:
    """Return a page that is one file, with scripts, what they draw and plotly.js inside it where there are scripts.

    The template extends "frame.html", and gets plain data. Scripts are files beside the templates, joined in this order
    after "common.js"; `figures`, plain data, is what they read, as `JSON.parse` gives it.
    """
    css, *js = (environment().loader.get_source(environment(), name)[0] for name in ("page.css", "common.js", *scripts))
    notice, script = plotly() if scripts else ("", "")
    packed = _packed(json.dumps(figures, allow_nan=False, separators=(",", ":")))
    return rendered(template, **data, css=css, js="\n".join(js), notice=notice, plotly=script, figures=packed)


@cache
def plotly() -> tuple[str, str]:
    """Return the notice of plotly.js and the script itself, packed; raises `InputError` where it is not installed."""
    script = extra("plotly.offline", "pictures", key="report").get_plotlyjs()
    return script[script.index("/*") + 2 : script.index("*/")].replace("--", "- -"), _packed(script)


def _packed(text: str) -> str:
    """Return gzip + base64 of a text; the same text gives the same characters."""
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


@cache
def environment() -> Any:
    """Return where templates are found, with the filters that they use; jinja2 is imported here, when one is drawn."""
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    made = Environment(autoescape=select_autoescape(["html"]), trim_blocks=True, lstrip_blocks=True)
    made.loader, made.undefined = PackageLoader("fcdm_opt.show"), StrictUndefined
    filters = cleaned, explained, in_unit, numbers, paragraphs, sentence, shown, signed, unbroken
    made.filters |= {own.__name__: own for own in filters}
    made.globals["glossary"] = EXPLAINED
    return made


def cleaned(text: object, longest: int = LONGEST) -> str:
    """Return a text without what no page may hold, on one line, and its middle left out where it is too long."""
    whole = str(text).encode("utf-8", "replace").decode()
    half = longest // 2
    if len(whole) > longest:
        whole = f"{whole[:half]} \u2026 {whole[-half:]}"
    kept = "".join(sign if sign.isprintable() or sign.isspace() else "\ufffd" for sign in whole)
    return " ".join(kept.split())


def explained(word: str, shown: str = "") -> Any:
    """Return a word of the glossary, which explains itself on hover, shown as another text where one is given."""
    from markupsafe import Markup

    return Markup('<abbr title="{}">{}</abbr>').format(EXPLAINED[word], shown or word)


def unbroken(text: str) -> Any:
    """Return a text in which no line ends behind a sign, as in "facing -" and "y", or before the unit of a motion."""
    from markupsafe import Markup, escape

    whole = rf"((?<![\w)])-|(?<=[A-Z] )(?=\d))[\w.]+( ({'|'.join(NANOMETRES)}|deg)\b)?"
    return Markup(re.sub(whole, r'<span class="whole">\g<0></span>', str(escape(text))))


def sentence(text: str) -> str:
    """Return a text with a capital first, unless a name and a colon begin it, and a full stop."""
    first, *_ = text.split(" ")
    whole = text if first.endswith(":") else f"{text[:1].upper()}{text[1:]}"
    return whole if whole.endswith((".", ":", "!", "?")) else f"{whole}."


def paragraphs(text: str | None) -> list[str]:
    """Return the paragraphs of a text, which are parted by empty lines."""
    return [line for piece in re.split(r"\n\s*\n", text or "") if (line := " ".join(piece.split()))]


def in_unit(text: str, unit: str | None) -> str:
    """Return a number with its unit, alone where there is no unit or no number."""
    return text if text in UNMEASURED else measured(text, unit or "")
