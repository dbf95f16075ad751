"""Contact features and their labels, as the FCDM paper writes them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Literal, cast

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.naming import element_text, names_of_faces, names_of_rows
from fcdm_opt.geometry.round_recognition import MANY_CORNERS

FeatureKind = Literal["V1V2", "V1E2", "E1V2", "E1E2", "V1F2", "F1V2", "E1F2", "F1E2", "F1F2"]

_VERTICES = r"V[1-9][0-9]*(?:,V[1-9][0-9]*)*"
_LABEL = re.compile(rf"([VEF])1([VEF])2\(P1({_VERTICES}); ?P2({_VERTICES})\)")
_COUNTS = {"V": range(1, 2), "E": range(2, 3), "F": range(3, 10**6)}


@dataclass(frozen=True, eq=False)
class Feature:
    """A contact feature: the element of body 1 and the element of body 2 that touch.

    Features are equal when their elements have the same vertices, in whatever order.

    Attributes
    ----------
    one, two : Element
        Vertex, edge or face of each body, with the body's own 1-based vertex labels.
    """

    one: Element
    two: Element

    @property
    def kind(self) -> FeatureKind:
        """For instance "V1F2": vertex of body 1 on a face of body 2."""
        return cast("FeatureKind", f"{self.one.kind}1{self.two.kind}2")

    @property
    def is_flush(self) -> bool:
        """Whether an edge or face lies on a face: more than a point is in contact."""
        return self.kind in ("F1F2", "F1E2", "E1F2")

    @property
    def label(self) -> str:
        """For instance "V1F2(P1V6; P2V2,V3,V5)"."""
        one, two = (",".join(f"V{v}" for v in element.vertices) for element in (self.one, self.two))
        return f"{self.kind}(P1{one}; P2{two})"

    def described(self, movable: Body, static: Body) -> str:
        """Return the label with names of the bodies' faces: F1F2(P1 bottom; P2 face 75), see `names_of_faces`."""
        words = []
        for element, body in ((self.one, movable), (self.two, static)):
            face = tuple(sorted(element.vertices))
            name = names_of_faces(body).get(face, "") if element.kind == "F" else ""
            corners = ",".join(f"V{v}" for v in element.vertices)
            words.append(corners if not name else f" {name}" if len(face) >= MANY_CORNERS else f"{corners} of {name}")
        return f"{self.kind}(P1{words[0]}; P2{words[1]})"

    def in_words(self, movable: Body, static: Body) -> str:
        """Return what meets what: "back face of key, face 8 (facing +y) of slot"."""
        words = list[str]()
        for own, body, part in ((self.one, movable, "the movable part"), (self.two, static, "the static part")):
            name = element_text(body, own)
            name = name if name.startswith("face ") else name.partition(" (facing")[0]  # a side tells it by its name
            words.append(f"{name} of {body.name or part}")
        return ", ".join(words)

    def spellings(self, movable: Body, static: Body) -> set[str]:
        """Texts that stand for this contact of two bodies: `described`, also by numbers of faces, `in_words`."""
        sides = list[set[str]]()
        for element, body in ((self.one, movable), (self.two, static)):
            corners, face = ",".join(f"V{v}" for v in element.vertices), tuple(sorted(element.vertices))
            names = {names_of_faces(body, four_digits=few).get(face) for few in (False, True)}
            if element.kind == "F" and face in (rows := (whole := body.full_body or body).face_rows):
                names |= {names_of_rows(whole)[rows[face]], f"face {rows[face] + 1}"}
            sides.append({corners, *(text for name in names - {None} for text in (f" {name}", f"{corners} of {name}"))})
        both = {f"{self.kind}(P1{one}; P2{two})" for one, two in product(*sides)}
        return both | {self.in_words(movable, static)}

    @property
    def _key(self) -> tuple[str, frozenset[int], frozenset[int]]:
        return self.kind, frozenset(self.one.vertices), frozenset(self.two.vertices)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Feature) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def __str__(self) -> str:
        return self.label

    @classmethod
    def from_label(cls, label: str) -> Feature:
        """Read a label back; raises `InputError` if it is none."""
        found = _LABEL.fullmatch(label.strip())
        texts = zip(found.group(1, 2), found.group(3, 4), strict=True) if found else ()
        elements = [Element(kind, tuple(int(v) for v in text.replace("V", "").split(","))) for kind, text in texts]
        if not elements or any(len(set(vertices)) not in _COUNTS[kind] for kind, vertices in elements):
            raise InputError("not a feature label", found=label, allowed="V1F2(P1V6; P2V2,V3,V5) and the like")
        return cls(*elements)

    @staticmethod
    def all_in_words(text: str, movable: Body, static: Body, keep_outs: Mapping[str, Body], head: str = "") -> str:
        """Return a text with `in_words` in place of each label after `head`, which is left out."""
        # "keep-out 'post' " before a label says what body 2 is

        def replaced(found: re.Match[str]) -> str:
            own, other = Feature.from_label(found[2]), keep_outs.get(found[1] or "", static)
            known = max(own.one.vertices) <= len(movable.vertices) and max(own.two.vertices) <= len(other.vertices)
            return own.in_words(movable, other) if known else found[2]  # else of points that they are exact at

        return re.sub(rf"{re.escape(head)}(?:keep-out '([^']*)' )?({_LABEL.pattern})", replaced, text)

    def merged(self, other: Feature) -> Feature | None:
        """Return the contact feature in which two features of one part pair meet, None if they share nothing."""
        elements = []
        for mine, theirs in ((self.one, other.one), (self.two, other.two)):
            common = tuple(v for v in mine.vertices if v in theirs.vertices)
            if not common:
                return None
            smaller = min((mine, theirs), key=lambda element: len(element.vertices))
            whole = len(common) == len(smaller.vertices) or len(common) > 2
            kind = smaller.kind if whole else "VE"[len(common) - 1]
            elements.append(Element(kind, tuple(sorted(smaller.vertices if whole else common))))
        return Feature(*elements)

    def starting_at(self, contact: Feature) -> Feature:
        """Return the feature with the vertex at which its contact starts written first in its edges, as in the paper.

        That is of `contact`, the contact feature of the switching point before it.
        """
        return Feature(
            *(
                Element("E", tuple(sorted(mine.vertices, key=lambda v: v not in start.vertices)))
                if mine.kind == "E" and start.kind == "V"
                else mine
                for mine, start in ((self.one, contact.one), (self.two, contact.two))
            )
        )


def is_within(one: Feature, other: Feature) -> bool:
    """Tell whether the elements of a feature have no vertices but those of another one's."""
    pairs = (one.one, other.one), (one.two, other.two)
    return all(set(part.vertices) <= set(whole.vertices) for part, whole in pairs)
