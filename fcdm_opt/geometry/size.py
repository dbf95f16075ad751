"""Sizes as drawings have them: a named way in which one body can come out different from drawn."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.errors import InputError, closest, known_arguments
from fcdm_opt.geometry.arrays import AXES, Array, Ints, frozen, groups_of, numbers
from fcdm_opt.geometry.bodies import Body, cached_per_body
from fcdm_opt.geometry.measures import cross
from fcdm_opt.geometry.naming import SIDES, faces_text, names_of_rows, selectors_of_rows
from fcdm_opt.geometry.polygons import distances, hold
from fcdm_opt.geometry.round_recognition import ROUND_KINDS, Round, round_faces
from fcdm_opt.geometry.tessellation import Swept
from fcdm_opt.geometry.units import measured, number_text, signed
from fcdm_opt.plain import Plain, plain
from fcdm_opt.tolerances import DEFAULT

FACES_LISTED = 12  # of a body, where none of them is meant
SELECTORS = (
    '"+x", "-z" (outward normal), "F3", "top" or "bore radius 8" (as `fcdm-opt faces` lists them; of a round face all '
    'facets), { through = [x, y, z] } (a point of the face) or { around = [x, y, z], axis = "z", radius = r } (all '
    "facets of a cylinder)"
)
_CLASS = r"[A-Za-z]{1,2}\d{1,2}"
FIT_LETTERS = re.compile(rf"\W*[\d.,]*\s*{_CLASS}(\s*[/-]?\s*{_CLASS})?\s*")  # "H7", "20 H7/g6"
NAMED = re.compile(rf"({'|'.join(SIDES)}|({'|'.join(ROUND_KINDS)}) radius \S+( to \S+)?)( no\. [0-9]+)?")
ROUND = 0.9  # a facet of a cylinder is at least this share of the radius away from its axis: seven facets and more


@known_arguments
@dataclass(frozen=True, eq=False)
class Size(Plain):
    """One named way in which a body can come out different from drawn; 0 is as drawn.

    Three kinds: faces that move outward (a length), faces that move together along a direction (a length), a scale
    about the seed (a share). A part with some of them is { x : n_f . x <= b_f + sum_k g_fk p_k } over its faces f.

    Parameters
    ----------
    name : str
        Once in a problem.
    body : "movable" or "static"
        Of an `Assembly` the name of a part.
    faces : selector or sequence of selectors, optional
        Outward normal ("+x"), a label or name that `fcdm-opt faces` lists ("F3", "top", "bore radius 8",
        "cone radius 4 to 8"; of a round face, by name or label, all facets; "top": all pieces of that end),
        {"through": (x, y, z)}, a point of the face, or {"around": (x, y, z), "axis": "z", "radius": r}, all facets of
        a cylinder. A normal that faces in several planes have is refused.
    each : number or sequence of numbers, optional
        Outward offset of the faces of each selector a unit of the size: 0.5 and 0.5 for a width between two faces.
        Default 1, for a single selector.
    along : axis, optional
        In place of `each`: the faces move together along "x", "-z" or a vector by the size.
    scale : "x", "y", "z", "xyz" or vector, optional
        In place of faces: X -> s + (1 + p) (X - s) about the seed s, along one axis or ("xyz") all.
    tolerance : number or (low, high), optional
        Least and largest deviation from drawn, length units or share; one number t stands for (-t, t).
    distribution : mapping or distribution, optional
        How it is distributed within: {"normal": {"cp": 1.0, "shift": 0.0}} (3 cp deviations to each limit; the shift
        of the mean from the middle in units of the tolerance), {"normal": {"sigma": s}} (standard deviation s, with
        "mean", default the middle, and "low", "high" where it is cut off), {"uniform": {}} or {"measured":
        [deviations]}; default normal with cp 1. Or a `Uniform`, `Normal` or `Measured` of deviations.

    Raises
    ------
    InputError
        Names the size, the argument, what was found and what is allowed.
    """

    name: str
    body: str
    _: KW_ONLY
    faces: Any = ()
    each: Any = None
    along: Any = None
    scale: Any = None
    tolerance: Any = None
    distribution: Any = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip() or not self.name.isprintable():
            raise InputError("a size needs a name", key="size", found=self.name, allowed="a text")
        if not isinstance(self.body, str) or not self.body:
            raise self._refused("no such body", "body", self.body, '"movable" or "static", or a part of an assembly')
        if not isinstance(self.faces, str | Mapping | Sequence) and self.faces is not None:
            raise self._refused("no faces", "faces", self.faces, SELECTORS)
        one = isinstance(self.faces, str | Mapping)
        faces = tuple(self._selector(item) for item in ([self.faces] if one else self.faces or ()))
        if bool(faces) == (self.scale is not None):
            raise self._refused("a size is of faces or a scale", "faces", self.faces, "faces, or scale")
        self._keep(faces=faces, scale=self._scale(), tolerance=self._range())
        for key in ("each", "along"):
            if self.scale is not None and getattr(self, key) is not None:
                raise self._refused("this goes with faces", key, getattr(self, key), "faces in place of scale")
        if self.along is not None:
            if self.each is not None:
                raise self._refused("faces move outward each, or along a direction", "along", self.along, "one of both")
            self._keep(along=self._axis(self.along, "along"))
        elif faces:
            self._keep(each=self._each(len(faces)))

    def is_beyond(self, off: float) -> bool:
        """Tell whether a deviation is outside of the tolerance, if there is one."""
        return self.tolerance is not None and not self.tolerance[0] <= off <= self.tolerance[1]

    def deviation_text(self, off: float, unit: str, digits: int = 6) -> str:
        """Return a deviation from drawn in words, of a scale in per cent: "+0.036 mm", "-0.1 %"."""
        exact = signed(off if self.is_length else 100.0 * off, digits) if off else "0"
        return measured(exact, unit if self.is_length else "%")

    @property
    def is_length(self) -> bool:
        """Whether it is a length; else it is a share."""
        return self.scale is None

    @property
    def middle(self) -> float:
        """Middle of the tolerance, 0 without one."""
        return 0.0 if self.tolerance is None else (self.tolerance[0] + self.tolerance[1]) / 2.0

    @property
    def half(self) -> float:
        """Half its width, 0 without one."""
        return 0.0 if self.tolerance is None else (self.tolerance[1] - self.tolerance[0]) / 2.0

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, as a `[[size]]` table has them."""
        named = {key: value for key, value in vars(self).items() if key != "_by_body"}
        return {key: plain(value) for key, value in named.items() if value is not None and value != ()}

    def of_body(self, name: str) -> Size:
        """Return the same size of the body by another name: one for each name, as results are kept by sizes."""
        known: dict[str, Size] = vars(self).setdefault("_by_body", {self.body: self})
        if name not in known:
            known[name] = replace(self, body=name)
            vars(known[name])["_by_body"] = known
        return known[name]

    def directions(self) -> Array:
        """Return U, (3, 3): the size moves a point X by p U (X - s); zero for faces."""
        if self.scale is None:
            return np.zeros((3, 3))
        if self.scale == "xyz":
            return np.eye(3)
        axis = np.array(AXES[self.scale] if isinstance(self.scale, str) else self.scale)
        return np.outer(axis, axis)

    def offsets(self, body: Body) -> Array:
        """Return how far each face of a body moves outward a unit of the size, (faces,); zero for a scale.

        Raises
        ------
        InputError
            For a selector that no face, or that faces in several planes meet, with the faces that there are.
        """
        return _offsets(self, body)

    def dimensions(self, body: Body, made: Mapping[Size, float] | None = None) -> dict[str, float]:
        """Return what it measures, by the face that this is measured to: "face bottom", "" where both ends are its own.

        A width, a diameter or radius, the length of what is scaled; of `body` as drawn, with what sizes `made` are off,
        those that move the other end too. Several where these part faces that are in one plane as drawn. Empty where
        nothing that can be measured on the part grows by as much as the size: where a slot moves as a whole, or a
        single face without just one plane opposite to it, or beside it as of a step; and where sizes part its own
        faces. Of the end of a tongue, a pin or a pocket it is how far that stands out of the plane that it stands on,
        not the part's own length.
        """
        found, off = _dimension(self, body), {own: x for own, x in (made or {}).items() if own.body == self.body}
        if found is None:
            return {}
        stretch, near = np.eye(3) + sum(x * own.directions() for own, x in off.items()), DEFAULT.nominal * body.size
        lengths = found.length / np.linalg.norm(np.linalg.solve(stretch, found.along.T), axis=0)[:, None]
        lengths = lengths + np.zeros((len(found.own), len(found.others)))
        moving = [own for own, x in off.items() if x and not (found.is_radius and own.along)]
        if found.own[0] < 0 and any(own.offsets(body).any() for own in moving):
            return {}  # ends in no face
        for own in moving if found.own[0] >= 0 else ():
            moved = off[own] * own._outward(body, found.own, found.along[0])[:, None]
            if not found.is_radius:
                stands = own._outward(body, found.others, found.side * found.along[0])
                moved = moved - off[own] * found.side * stands
            lengths = lengths + found.rate * moved
        if not np.ptp(lengths, axis=0).max() <= near:
            return {}
        alike = groups_of(np.unique(np.rint(lengths[0] / near), return_inverse=True)[1])
        names = [faces_text(body, found.others[each].tolist()) * (not found.is_whole) for each in alike]
        each = {name: float(lengths[0, own[0]]) for name, own in zip(names, alike, strict=True)}
        return each if len(each) == len(alike) else {}

    def position(self, body: Body, made: Mapping[Size, float] | None = None) -> float:
        """Return where the axis or centre of what moves is, along the direction it moves in; nan of others.

        `body` as drawn, `made` what sizes are off.
        """
        rounds = [] if self.along is None else self._round_faces(body)
        if not rounds:
            return np.nan
        along, off = np.array(self.along), {own: x for own, x in (made or {}).items() if own.body == self.body}
        stretch = np.eye(3) + sum(x * own.directions() for own, x in off.items())
        rows = np.flatnonzero(self.offsets(body))
        shift = sum(x * along @ own.along for own, x in off.items() if own.along and own.offsets(body)[rows].any())
        places = [float(along @ (body.seed + stretch @ (face.surface.origin - body.seed)) + shift) for face in rounds]
        across = all(abs(face.surface.axis @ along) <= DEFAULT.nominal for face in rounds)
        return places[0] if across and np.ptp(places) <= DEFAULT.snap * body.size else np.nan

    def _outward(self, body: Body, rows: Ints, normal: Array) -> Array:
        """Return how far faces move outward a unit of the size, (rows,), where round ones have that normal."""
        moved = self.offsets(body)[rows]
        return moved if self.along is None else np.where(moved, normal @ np.array(self.along), 0.0)

    def _round_faces(self, body: Body) -> list[Round]:
        """Return the cylinders and spheres that make up its faces; none where there are other faces, too."""
        labels = {tuple(sorted(body.faces[k])) for k in np.flatnonzero(self.offsets(body)).tolist()}
        found = [face for face in round_faces(body) if labels & set(face.faces)]
        every = {label for face in found for label in face.faces}  # facets along a direction do not move
        whole = labels == every or (self.along is not None and labels <= every)
        return found if whole and not any(face.name.startswith(ROUND_KINDS[4:]) for face in found) else []

    def _keep(self, **values: Any) -> None:
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def _refused(self, what: str, key: str, found: Any, allowed: str) -> InputError:
        return InputError(what, key=f"size '{self.name}'.{key}", found=found, allowed=allowed)

    def _numbers(self, value: Any, key: str, count: int, allowed: str) -> tuple[float, ...]:
        try:
            found = numbers(value, key).ravel()
        except InputError:
            found = np.empty(0)
        flags = any(isinstance(item, bool | np.bool_) for item in (value, *(value if np.ndim(value) == 1 else ())))
        if flags or isinstance(value, str) or found.size != count or not np.isfinite(found).all():
            raise self._refused("unusable numbers", key, value, allowed)
        return tuple(found.tolist())

    def _axis(self, value: Any, key: str) -> tuple[float, ...]:
        if isinstance(value, str) and (word := value.removeprefix("+")) in AXES:
            return AXES[word]
        allowed = '"x", "y", "z", "-x", "-y", "-z" or a vector that is not zero'
        axis = np.array(self._numbers(value, key, 3, allowed))
        length = float(np.linalg.norm(axis))
        if not length > 0.0:
            raise self._refused("no direction", key, value, allowed)
        return tuple((axis / length).tolist())

    def _selector(self, value: Any) -> Any:
        if isinstance(value, str) and re.fullmatch(r"[+-]?[xyz]|F[1-9][0-9]*", value):
            return value if value[0] in "+-F" else f"+{value}"
        if isinstance(value, str) and NAMED.fullmatch(value):
            return value
        if isinstance(value, Mapping) and set(value) == {"through"}:
            return {"through": self._numbers(value["through"], "faces.through", 3, "a point (x, y, z)")}
        if isinstance(value, Mapping) and set(value) == {"around", "axis", "radius"}:
            (radius,) = self._numbers(value["radius"], "faces.radius", 1, "a length > 0")
            if not radius > 0.0:
                raise self._refused("no radius", "faces.radius", radius, "a length > 0")
            around = self._numbers(value["around"], "faces.around", 3, "a point (x, y, z)")
            return {"around": around, "axis": self._axis(value["axis"], "faces.axis"), "radius": radius}
        hint = closest(value, SIDES) if isinstance(value, str) else ""
        raise self._refused(f"no face is named like this{hint}", "faces", value, SELECTORS)

    def _scale(self) -> Any:
        if self.scale is None or (isinstance(self.scale, str) and self.scale in ("xyz", *"xyz")):
            return self.scale
        if isinstance(self.scale, str):
            raise self._refused("unknown scale", "scale", self.scale, '"xyz", "x", "y", "z" or a vector')
        return self._axis(self.scale, "scale")

    def _each(self, count: int) -> tuple[float, ...]:
        if self.each is None:
            if count > 1:
                allowed = "0.5 of a width between two faces, 1 of faces of one level, or a number for each selector"
                raise self._refused("how far does each face move?", "each", None, allowed)
            return (1.0,)
        single = np.ndim(self.each) == 0
        given = self._numbers(self.each, "each", 1 if single else count, f"a number, or {count}, one a selector")
        return given * (count if single else 1)

    def _range(self) -> tuple[float, float] | None:
        if self.tolerance is None:
            return None
        tolerance = self.tolerance
        share = "a share: 0.003 is 0.3 %" if self.scale is not None else "a length in the file's unit"
        allowed = f"{share}; (low, high) with low <= high, or one number t for (-t, t)"
        if isinstance(tolerance, str) and FIT_LETTERS.fullmatch(tolerance):
            allowed = (
                "tolerance = [LOWER, UPPER], the deviations that ISO 286 has for it at the diameter, in the file's "
                "unit, bore and shaft each in a size of its own: at 20 mm [0.0, 0.021] of H7, [-0.020, -0.007] of g6"
            )
            raise self._refused("letters of a fit are not known here", "tolerance", tolerance, allowed)
        if isinstance(tolerance, str):
            what = "a scale has no unit: divide by the length that it is of" if self.scale else "a number without unit"
            raise self._refused(what, "tolerance", tolerance, allowed)
        if np.ndim(tolerance) == 0:
            (most,) = self._numbers(tolerance, "tolerance", 1, allowed)
            low, high = -most, most
        else:
            low, high = self._numbers(tolerance, "tolerance", 2, allowed)
        if not low <= high:
            raise self._refused("the low end is above the high one", "tolerance", tolerance, allowed)
        if self.scale is not None and not low > -1.0:
            raise self._refused("nothing would be left of the body", "tolerance", tolerance, allowed)
        return low, high

    def _selected(self, selector: Any, body: Body, normals: Array, points: Array, key: str) -> Ints:
        """Return the rows of the faces that a selector means."""
        near = DEFAULT.nominal
        if isinstance(selector, str) and NAMED.fullmatch(selector):
            for four_digits in (False, True):  # files may have radii to fewer digits
                named: dict[str, list[int]] = {}
                for row, name in enumerate(names_of_rows(body, four_digits=four_digits)):
                    end = name.split(" no. ")[0]
                    for label in dict.fromkeys((name, end if end in SIDES else name)):  # "top": all in its plane
                        named.setdefault(label, []).append(row)
                if selector in named:
                    return np.array(named[selector])
            known = ", ".join(dict.fromkeys(selectors_of_rows(body)))
            raise self._refused(f"no face of body '{body.name}' has this name", key, selector, known)
        if isinstance(selector, str) and selector[0] == "F":
            row, every = int(selector[1:]) - 1, names_of_rows(body)
            if row >= len(normals):
                last = max(map(every.index, every))  # a facet of a round face means all of it, as it is listed
                raise self._refused("no such face", key, selector, f"F1 to F{last + 1}")
            return np.array([k for k, name in enumerate(every) if name == every[row]])
        if isinstance(selector, str):
            n = np.array(AXES[selector.removeprefix("+")])
            rows = np.flatnonzero(np.abs(normals - n).max(axis=1) <= near)
            flat = rows[_facets(body)[1][rows] == 0.0]  # facets of a bore are none of a block's sides
            rows = flat if flat.size else rows
        elif "through" in selector:
            # in the plane of a face, and in one of its triangles: a facet of a part may span several faces of a plane
            point, (triangles, owners) = np.array(selector["through"]), body.face_triangles
            n, snap = normals[owners], DEFAULT.snap * body.size
            on = np.abs(((point - triangles[:, 0]) * n).sum(axis=1)) <= snap
            rows = np.unique(owners[on & hold(triangles, n, point[None], snap)[0]])
            for face, facets in _facets(body)[0]:
                own = triangles[np.isin(owners, facets)]
                off, farthest = face.surface.misses(point[None])[0][0], face.surface.deviations(own).max()
                on_it = not rows.size and abs(off) <= snap and distances(point, own).min() <= snap + farthest
                if on_it or (rows.size and np.isin(rows, facets).all()):
                    return facets
        else:
            axis, radius = np.array(selector["axis"]), selector["radius"]
            level = np.abs((normals * (points - np.array(selector["around"]))).sum(axis=1))
            parallel = np.abs(normals @ axis) <= near
            most = (1.0 + DEFAULT.snap) * radius
            rows = np.flatnonzero(parallel & (level >= ROUND * radius) & (level <= most))
            off = np.linalg.norm(np.cross(body.vertices - np.array(selector["around"]), axis), axis=1)
            rows = np.array([k for k in rows.tolist() if off[np.array(body.faces[k]) - 1].max() <= most], np.int64)
            if rows.size:
                return rows
        if not rows.size:
            order, what = (
                np.arange(len(normals)),
                f"no face of body '{body.name}' looks that way: of one moved name labels",
            )
            if "through" in selector:  # nearest first, by the boxes about faces
                corners = [body.vertices[np.array(face) - 1] - np.array(selector["through"]) for face in body.faces]
                off = [np.maximum(own.min(axis=0), -own.max(axis=0)).clip(min=0.0) for own in corners]
                order = np.linalg.norm(off, axis=1).argsort(kind="stable")
                what = f"no face of body '{body.name}' goes through this point"
            elif not isinstance(selector, str):
                what = f"body '{body.name}' has no such cylinder"
            listed = [
                f"F{k + 1} ({direction(normals[k])}, {direction_level(normals[k], points[k])})" for k in order.tolist()
            ]
            there, more = ", ".join(listed[:FACES_LISTED]), ", ..." if len(normals) > FACES_LISTED else ""
            raise self._refused(what, key, selector, there + more)
        first = rows[0]
        away = np.abs((points[rows] - points[first]) @ normals[first]) > near * body.size
        if (away | (np.abs(normals[rows] - normals[first]).max(axis=1) > near)).any():
            several = ", ".join(f'"F{k + 1}" at {direction_level(normals[k], points[k])}' for k in rows.tolist())
            raise self._refused(f"several faces of body '{body.name}' are meant", key, selector, f"one of {several}")
        return rows


class _Dimension(NamedTuple):
    """A length that a size is the deviation of, as drawn, between faces by their rows: -1 where there is none."""

    length: float
    along: Array  # directions in which it is measured, (1 or faces, 3)
    own: Ints  # faces at one end, or of what is round
    others: Ints  # faces at the other end
    rate: float  # by how much it grows a unit that the own faces move outward
    is_whole: bool  # whether both ends are the size's
    side: float = -1.0  # 1 where the other faces look the same way: of a step

    @property
    def is_radius(self) -> bool:
        """Whether it is a radius or a diameter."""
        return bool(self.own[0] >= 0 > self.others[0])


@lru_cache(maxsize=128)
def _dimension(size: Size, body: Body) -> _Dimension | None:
    """Return what a size measures, None where that is no length."""
    normals, none, near = body.face_planes[0], np.array([-1]), DEFAULT.nominal * body.size
    moved, grown = size.offsets(body), dict[float, _Dimension]()  # by how much it grows a unit of the size
    if size.scale is not None:
        longest = np.eye(3)[np.ptp(body.vertices @ size.directions(), axis=0).argmax()]
        along = longest if isinstance(size.scale, str) else np.array(size.scale)
        looks, levels = _along(body, along)
        ends = [np.flatnonzero(looks == side) for side in (1.0, -1.0)]
        at = np.concatenate([body.vertices @ along, levels[np.concatenate(ends)]])
        high, low = float(at.max()), float(at.min())
        own, others = (rows[abs(levels[rows] - x) <= near] for rows, x in zip(ends, (high, low), strict=True))
        own, others = (own, others) if len(own) and len(others) else (none, none)
        return _Dimension(high - low, along[None], own, others, 1.0, True)
    rows, rounds = np.flatnonzero(moved), size._round_faces(body)
    if len({face.name for face in rounds}) == 1 and np.ptp(moved[rows]) == 0.0:
        side = 1.0 if rounds[0].name.startswith(ROUND_KINDS[::2]) else -1.0
        for k in (1.0, 2.0):
            length = k * rounds[0].surface.radius
            grown[side * k * float(moved[rows[0]])] = _Dimension(length, normals[rows], rows, none, side * k, True)
    bends = _facets(body)[1]
    plane = rows[bends[rows] == 0.0]
    along = normals[plane[-1]] if len(plane) else np.sign(moved.sum()) * np.array(size.along or (0.0, 0.0, 0.0))
    looks, levels = _along(body, along)
    ahead, across = (np.flatnonzero(looks == side) for side in (1.0, -1.0))
    own, also = np.intersect1d(ahead, rows), np.intersect1d(across, rows)
    if not len(own) or np.isin(rows, [*own, *also, *np.flatnonzero(np.isnan(looks))], invert=True).any():
        ahead = across = also = rows[:0]
    elif not len(also):  # bores and cradles where there is nothing else
        outward = float(size._outward(body, own[:1], along)[0])
        across, inside = (
            _opposite(body, own, across[(bends[across] < 0.0) == bore], levels, outward) for bore in (False, True)
        )
        across = across if len(across) else inside
    several = not len(also) and len(across) > 0 and np.ptp(levels[across]) > near
    steps = np.setdiff1d(ahead[bends[ahead] == 0.0], rows)
    for others in (also,) if len(also) else (across, steps):  # these stay: a width, or a step
        if len(others) and max(np.ptp(levels[own]), np.ptp(levels[others])) <= near:
            flat, side = others[bends[others] == 0.0], float(looks[others[0]])
            others = flat if len(flat) else others  # not what is tangent to them
            width, is_whole = float(levels[own[0]] - levels[others[0]]), len(also) > 0
            found = _Dimension(abs(width), along[None], own, others, float(np.sign(width)), is_whole, side)
            apart = size._outward(body, own[:1], along) - side * size._outward(body, others[:1], side * along)
            rate = found.rate * float(apart[0])
            first = rate not in grown and not several
            shorter = rate not in grown or found.length < grown[rate].length
            if first or (shorter and _surrounded(body, own, others)):
                grown[rate] = found
    return next((found for rate, found in grown.items() if abs(rate - 1.0) <= DEFAULT.nominal), None)


def _along(body: Body, along: Array) -> tuple[Array, Array]:
    """Return how faces look along a direction and where they lie, those that stand for round ones as these, (faces,).

    1 where a face is across it and looks that way, -1 the other way, 0 elsewhere; of a round face where it is tangent
    to such a plane all facets on that side, nan for those on neither.
    """
    (normals, points), (rounds, bends), near = body.face_planes, _facets(body), DEFAULT.snap * body.size
    slopes, levels = normals @ along, points @ along
    looks = np.where(np.abs(np.abs(slopes) - 1.0) <= DEFAULT.nominal, np.sign(slopes), 0.0)
    looks[bends != 0.0] = 0.0
    planes = {side: levels[looks == side] for side in (1.0, -1.0)}
    for face, rows in rounds:
        for side, flat in planes.items():
            mine = rows[side * slopes[rows] > DEFAULT.nominal]
            there = _tangent_point(body, face.surface, mine, side * float(bends[rows[0]]) * along)
            if there is None:
                continue
            point, is_inside = there
            flush = flat[np.abs(flat - point @ along) <= near]  # of a plane that it ends at, tangent to it
            if is_inside or len(flush):
                looks[rows] = np.where(looks[rows] == 0.0, np.nan, looks[rows])
                looks[mine], levels[mine] = side, float(point @ along) if is_inside else flush[0]
    return looks, levels


@cached_per_body
def _facets(body: Body) -> tuple[list[tuple[Round, Ints]], Array]:
    """Return the round faces of a body, each with the rows of the facets that stand for it, and what faces are.

    0 of plane faces, 1 of round ones, -1 of bores and other hollow ones, (faces,).
    """
    bends = np.zeros(len(body.faces))
    bends[[row for _, own in body.surfaces or () for row in own]] = 1.0  # tori have no name
    found = [(face, np.array([body.face_rows[label] for label in face.faces])) for face in round_faces(body)]
    for face, rows in found:
        bends[rows] = -1.0 if face.name.startswith(ROUND_KINDS[1::2]) else 1.0
    return found, frozen(bends)


def _tangent_point(body: Body, surface: Swept, rows: Ints, outward: Array) -> tuple[Array, bool] | None:
    """Return a point of a surface, away from its axis or centre, whose normal is a direction, on some facets of it.

    And whether there is more of it on all sides of that point. None where the facets, of which all look that way or
    back, end before it.
    """
    if surface.line is None:
        point, tangents = surface.origin + surface.radius * outward, np.linalg.svd(outward[None])[2][1:]
    else:
        c, s = surface.line
        across = outward - (outward @ surface.axis) * surface.axis
        if abs(outward @ surface.axis + s) > DEFAULT.snap:
            return None
        point = surface.origin + surface.radius / c**2 * across
        tangents = cross(surface.axis, across)[None] / c
    triangles, owners = body.face_triangles
    near, corners = DEFAULT.snap * body.size, triangles[np.isin(owners, rows)] - point
    off = corners @ tangents.T
    if len(tangents) == 1:
        held = ((off.min(axis=1) <= near) & (off.max(axis=1) >= -near)).any()
    else:
        looks = np.sign(cross(*(corners[:, k] - corners[:, 0] for k in (1, 2))) @ outward)[:, None] * outward
        held = hold(corners - (corners @ outward)[..., None] * outward, looks, np.zeros((1, 3)), near).any()
    ends = off.reshape(-1, len(tangents))
    return (point, bool((ends.min(axis=0) < -near).all() and (ends.max(axis=0) > near).all())) if held else None


def spans(body: Body, rows: Sequence[int]) -> tuple[Array, Array]:
    """Return the least and the largest coordinates of faces along two axes in the plane of the first, (faces, 2)."""
    sides = np.linalg.svd(body.face_planes[0][[*rows[:1]]])[2][1:].T
    each = [body.vertices[np.array(body.faces[k]) - 1] @ sides for k in rows]
    return np.array([x.min(axis=0) for x in each]), np.array([x.max(axis=0) for x in each])


def _opposite(body: Body, own: Ints, across: Ints, levels: Array, moved: float) -> Ints:
    """Return which of the faces that look the other way faces are opposite to, through room or through material."""
    # those nearest along the normal on the side from which the faces move away, of those they overlap in projection
    lows, highs = spans(body, [*own, *across])
    low, high = lows[: len(own)].min(axis=0), highs[: len(own)].max(axis=0)
    lows, highs = np.maximum(lows[len(own) :], low), np.minimum(highs[len(own) :], high)
    off = -np.sign(moved) * (levels[across] - levels[own[0]])
    known = (highs > lows).all(axis=1) & (off > DEFAULT.nominal * body.size)
    near = known & (off <= off[known].min(initial=np.inf) + DEFAULT.nominal * body.size)
    hidden = [((a >= lows[near]) & (b <= highs[near])).all(axis=1).any() for a, b in zip(lows, highs, strict=True)]
    return across[known & (near | ~np.array(hidden, bool))]  # those behind them that show beside them, too


def _surrounded(body: Body, own: Ints, others: Ints) -> bool:
    """Tell whether faces that look the same way lie all round some, seen along the normal: those end a feature."""
    sides = np.linalg.svd(body.face_planes[0][own[:1]])[2][1:].T
    mine, theirs = (body.vertices[np.concatenate([body.faces[k] for k in rows]) - 1] @ sides for rows in (own, others))
    if (mine.min(axis=0) < theirs.min(axis=0)).any() or (mine.max(axis=0) > theirs.max(axis=0)).any():
        return False  # a rim about a floor, say
    angles = np.sort(np.arctan2(*(theirs - mine.mean(axis=0)).T))
    return bool(np.diff(angles, append=angles[0] + 2.0 * np.pi).max() < np.pi - DEFAULT.nominal)


@lru_cache(maxsize=128)  # studies and maps ask for the same faces of the same body at each of their points
def _offsets(size: Size, body: Body) -> Array:
    if body.at_scale is not None:
        return frozen(body.at_scale[1] * _offsets(size, body.at_scale[0]))
    normals, points = body.face_planes
    moved, taken = np.zeros(len(normals)), np.zeros(len(normals), bool)
    each = size.each if size.along is None else [None] * len(size.faces)
    for k, selector in enumerate(size.faces):
        rows = size._selected(selector, body, normals, points, f"faces[{k + 1}]")
        if taken[rows].any():
            names = ", ".join(f"F{row + 1}" for row in rows[taken[rows]].tolist())
            raise size._refused(f"face {names} is meant twice", f"faces[{k + 1}]", selector, "each face once")
        taken[rows] = True
        moved[rows] = each[k] if size.along is None else normals[rows] @ np.array(size.along)
    if size.faces and not moved.any():
        key, allowed = ("each", "not all 0") if size.along is None else ("along", "a direction across a face")
        raise size._refused("no face is moved by this size", key, getattr(size, key), allowed)
    return frozen(moved)


def direction(normal: Array) -> str:
    """Return an outward normal in words: "+x", or its three numbers."""
    k = int(np.abs(normal).argmax())
    if np.abs(np.delete(normal, k)).max() <= DEFAULT.nominal:
        return f"{'-' if normal[k] < 0 else '+'}{'xyz'[k]}"
    return f"({', '.join(number_text(x, 4) for x in normal.tolist())})"


def direction_level(normal: Array, point: Array) -> str:
    """Return where a face lies: "x = 2" for one across an axis, else its normal and its height along it."""
    word, k = direction(normal), int(np.abs(normal).argmax())
    place, level = number_text(float(point[k])), number_text(float(normal @ point))
    return f"{word[1]} = {place}" if len(word) == 2 else f"{word} . X = {level}"
