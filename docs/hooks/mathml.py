r"""Equations: LaTeX becomes MathML while the site is built, so that pages need no script and no network to show them.

`pymdownx.arithmatex` finds the equations; this turns them into MathML, which browsers draw themselves. A displayed
equation with `\tag{7}` gets the number (7) in the margin and the anchor `#eq-7`.
"""

from __future__ import annotations

import logging
import re
from html import unescape
from typing import Any
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markdown import Markdown
from markdown.extensions import Extension
from markdown.treeprocessors import Treeprocessor

LOG = logging.getLogger("mkdocs.hooks.mathml")  # a warning fails the strict build
AFTER_INLINE, BEFORE_ANCHORS = 20, 5  # priorities of Markdown's inline patterns, and of mkdocs' list of anchors
NAMESPACE = ' xmlns="http://www.w3.org/1998/Math/MathML"'  # HTML knows it by itself
TAG = re.compile(r"\\tag\{(\d+)\}")
OPENING = ("(", "[", "{", "=", ",", "\N{MINUS SIGN}", "\N{LESS-THAN OR EQUAL TO}", "\N{GREATER-THAN OR EQUAL TO}")
BELOW = ("max", "min", "\N{N-ARY UNION}")  # what carries its index below it in a displayed equation
LEFT_OVER = re.compile(r"\\[A-Za-z]+")  # a command that the converter does not know stays in its output as it is


def on_config(config: Any) -> Any:
    """Add the conversion to the Markdown extensions."""
    config["markdown_extensions"].append(Equations())
    return config


class Equations(Extension):
    """Turn what `pymdownx.arithmatex` found into MathML."""

    def extendMarkdown(self, md: Markdown) -> None:  # noqa: N802 (the name is Markdown's)
        """Register the conversion after the inline patterns, before mkdocs lists the anchors of a page."""
        md.treeprocessors.register(_Conversion(md), "mathml", (AFTER_INLINE + BEFORE_ANCHORS) / 2)


class _Conversion(Treeprocessor):
    def run(self, root: ElementTree.Element) -> None:
        """Convert all equations of a page in place; numbers must count from 1 without a gap."""
        numbers: list[int] = []
        for element in root.iter():
            if element.get("class") != "arithmatex":
                continue
            source = unescape("".join(element.itertext())).strip()
            tag = TAG.search(source)
            display = source.startswith("\\[")
            equation = converted(TAG.sub("", source[2:-2]).strip(), display=display)
            element.text = None
            for child in list(element):
                element.remove(child)
            element.append(equation)
            if tag:
                numbers.append(int(tag[1]))
                element.set("class", "equation numbered")
                element.set("id", f"eq-{tag[1]}")
                ElementTree.SubElement(element, "span", {"class": "number"}).text = f"({tag[1]})"
            elif display:
                element.set("class", "equation")
        if numbers != list(range(1, len(numbers) + 1)):
            LOG.warning("equation numbers are not 1, 2, 3, ...: %s", numbers)


def converted(source: str, *, display: bool = False) -> ElementTree.Element:
    """Return LaTeX as a MathML element; warns of what cannot be converted."""
    try:
        text = convert(source, display="block" if display else "inline").replace(NAMESPACE, "")
        element = ElementTree.fromstring(text)
    except Exception as reason:  # the converter's errors have no base of their own
        LOG.warning("no equation: %s: %s: %s", source, type(reason).__name__, reason)
        return ElementTree.Element("math")
    if unknown := LEFT_OVER.findall(text):
        LOG.warning("unknown in an equation: %s: %s", ", ".join(unknown), source)
    element.set("alttext", source)
    for part in element.iter():  # what browsers ask for, where the converter writes it otherwise
        if display and part.tag == "msub" and part[0].text in BELOW:
            part.tag = "munder"
        if part.tag == "mtext" and (part.text or "").isalpha():  # a name: text counts as space around operators
            part.tag = "mi"
            part.set("mathvariant", "normal")
        before: str | None = "("
        for sign in part if part.tag in ("mrow", "mtd") else ():
            if sign.text == "\N{MINUS SIGN}" and before in OPENING:
                sign.set("form", "prefix")  # a sign, not a difference
            if sign.text == "|":
                sign.attrib.update(lspace="0", rspace="0")
            before = sign.text if sign.tag == "mo" else before if sign.tag == "mspace" else None
        if side := part.attrib.pop("columnalign", None):
            part.set("style", f"text-align: {side}")
    return element
