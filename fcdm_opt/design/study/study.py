"""A study: one problem, or several cases of it, with some of its keys varied."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

from fcdm_opt.design.places import Place, overlap, parse
from fcdm_opt.design.question import Question, canonical, digest, excluded, located, plain_value
from fcdm_opt.design.study.schema import Sampling, StudyArguments, StudyFile, YieldEntry
from fcdm_opt.design.study.variables import MOST, PARAMETERS, Derivation, Variable, shares, variable_of
from fcdm_opt.errors import InputError, checked_path, closest, known_arguments, name_list, placed
from fcdm_opt.problem.arguments import items
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.schema import checked, read_entry
from fcdm_opt.problem.solution import Effort
from fcdm_opt.version import __version__

RESERVED = ("case", "draw", "number", "key")  # columns that every table of results may have
MOST_POINTS = 10**12  # more than any run will see the end of
_REFERENCES = ("published", "published_text")  # of a case: never used in solving, and of one motion only


class StudyPoint(NamedTuple):
    """One point of a study: its number in the order of the axes, the last of them fastest, and the values by label.

    Points with equal keys have equal answers. The question is without mesh files, None where the values make none;
    `error` says why.
    """

    number: int
    key: str
    values: dict[str, Any]
    question: Question | None
    error: str = ""


@known_arguments
@dataclass(frozen=True, eq=False)
class Study:
    """A problem with some of its keys varied: every combination of the listed values, times the draws.

    Nothing is solved here: see `run_study`. All keys and listed values are checked when a study is made; values that
    only fail together, or for the bodies as they come out, make a point with an error.

    Parameters
    ----------
    problem : path, Problem, Assembly, Question, or a sequence of these
        What is varied; a problem file with all its cases.
    vary : mapping of key to values, or sequence of Variable
        A key is a place such as "tolerance", "target[1]", "limits.RZ_deg", `bodies.movable.vertices[5][3]`, of an
        assembly "scales.slide" or "part.slide.limits.TZ", or "parameters.draft_deg", or a tuple of such keys that vary
        together. Values: a list (with several keys, of lists), a mapping of names to values, or `Uniform`, `Normal`,
        `Measured`. None stands for the default.
    parameters : mapping of name to number or expression
    derive : mapping of key to value
        Texts in a value, at any depth, are expressions in the parameters; `{"text": "..."}` is a text.
    cases : sequence of str, optional
        Names of the cases to take; default all.
    sampling : "latin hypercube" or "random"
        How numbers are drawn.
    count : int, optional
        How many joint draws of all that has a distribution; every combination of listed values has the same ones.
    seed : int
        What the draws follow from.
    certify : bool
        Whether the motions are to be proved smallest.
    effort : "proved" or "quick"
        As of `solve`: "quick" proves nothing, for many points.
    time_limit : float, optional
        Seconds a point.
    budget : float, optional
        The largest affordable amount.
    title, note : str
    folder : path, optional
        Where paths of mesh files among the values start; default the working folder.

    Raises
    ------
    InputError
        Names the key, what was found and what is allowed.
    """

    problem: Any
    vary: Any = ()
    _: KW_ONLY
    parameters: Mapping[str, Any] = field(default_factory=dict)
    derive: Mapping[str, Any] = field(default_factory=dict)
    cases: Sequence[str] | None = None
    sampling: Sampling = "latin hypercube"
    count: int | None = None
    seed: int = 1
    certify: bool = False
    effort: Effort = "proved"
    time_limit: float | None = None
    budget: float | None = None
    title: str = ""
    note: str = ""
    folder: Any = None

    def __post_init__(self) -> None:
        self._check_arguments()
        _check_keys(self)
        self._check_draws()
        for base in self.questions:
            _check_values(self, base)

    def _check_arguments(self) -> None:
        """Refuse arguments of the wrong kind, in the words of a study file; keep plain values."""
        given = {key: plain_value(getattr(self, key)) for key in StudyArguments.model_fields}
        plain = dict(checked(StudyArguments, {key: value for key, value in given.items() if value is not None}))
        if self.budget is not None:
            plain |= dict(checked(YieldEntry, {"budget": plain_value(self.budget)}))
        self.__dict__.update(plain)
        if self.count is not None and self.count > MOST:
            raise InputError("too many draws", key="count", found=self.count, allowed=f"at most {MOST}")
        if self.certify and self.effort == "quick":
            what = "a quick search proves nothing"
            raise InputError(what, key="effort", found="quick", allowed="proved, with certify")

    def _check_draws(self) -> None:
        """Refuse distributions without a number of draws and the other way round, and points without end."""
        drawn = [variable for variable in self.variables if variable.drawn]
        if drawn and self.count is None:
            raise InputError(
                "how many numbers to draw?", key="count", found=f"none, with a distribution in {drawn[0].where}",
                allowed="a whole number >= 1",
            )  # fmt: skip
        if self.count is not None and not drawn:
            allowed = "no count, or a variable with a distribution"
            raise InputError("nothing is drawn", key="count", found=self.count, allowed=allowed)
        if len(self) > MOST_POINTS:
            raise InputError("too many points", key="vary", found=len(self), allowed=f"at most {MOST_POINTS}")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Study:
        """Return the study of a file (TOML); paths in it start from its folder.

        Raises
        ------
        InputError
            Names the file, the key, what was found and what is allowed.
        """
        path = checked_path(path, "study file")
        file: Any = read_entry(StudyFile, path, "study file", "problem and [[vary]]")
        budget = getattr(file, "yield")
        with placed(file=path):
            return cls(
                located(file.problem, path.parent),
                [variable_of(entry, f"vary[{k}]", path.parent) for k, entry in enumerate(file.vary, 1)],
                **{key: getattr(file, key) for key in StudyArguments.model_fields},
                budget=None if budget is None else budget.budget,
                folder=path.parent,
            )

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """What varies, in order."""
        if isinstance(self.vary, Mapping):
            return tuple(
                Variable(keys, list(values.values()), names=tuple(values))
                if isinstance(values, Mapping)  # of names to values
                else Variable(keys, values)
                for keys, values in self.vary.items()
            )
        given = tuple(self.vary) if isinstance(self.vary, list | tuple) else (self.vary,)
        if not all(isinstance(variable, Variable) for variable in given):
            allowed = '{"tolerance": [0.01, 0.02], ...}: keys of a problem with their values'
            raise InputError("nothing that varies", key="vary", found=self.vary, allowed=allowed)
        return given

    @cached_property
    def questions(self) -> tuple[Question, ...]:
        """The cases, as plain tables, before anything is varied."""
        found = _questions(self.problem)
        names = [question.name for question in found]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise InputError("two problems of one name", key="problem", found=name, allowed="a name for each")
        if self.cases is not None:
            chosen = items(self.cases)
            if not chosen:
                raise InputError("no case", key="cases", found=self.cases, allowed=f"some of {', '.join(names)}")
            for k, name in enumerate(chosen, 1):
                what = "given twice" if name in chosen[: k - 1] else f"no such case{closest(str(name), names)}"
                if name not in names or name in chosen[: k - 1]:
                    raise InputError(what, key=f"cases[{k}]", found=name, allowed=name_list(names))
            found = tuple(found[names.index(name)] for name in chosen)
        return tuple(
            replace(question, case={key: value for key, value in question.case.items() if key not in _REFERENCES})
            for question in found
        )

    @cached_property
    def derivation(self) -> Derivation:
        """What follows from parameters."""
        varied = {str(place[1]) for variable in self.variables for place in variable.places if place[0] == PARAMETERS}
        return Derivation.of(self.parameters, self.derive, varied)

    @cached_property
    def _draws(self) -> dict[Variable, Any]:
        drawn = [variable for variable in self.variables if variable.drawn]
        if not drawn or self.count is None:
            return {}
        cube = shares(self.sampling, self.count, len(drawn), seed=self.seed)
        return {variable: variable.values.quantile(row) for variable, row in zip(drawn, cube, strict=True)}

    @cached_property
    def axes(self) -> dict[str, Sequence[Any]]:
        """Label -> values: of the cases where there are several, of each listed variable, and "draw" for the draws.

        Values of several keys are tuples; names stand for the values that have them.
        """
        made: dict[str, Sequence[Any]] = {}
        if len(self.questions) > 1:
            made["case"] = tuple(question.name for question in self.questions)
        for variable in self.variables:
            if not variable.drawn:
                made[variable.label] = variable.axis
        if self.count is not None:
            made["draw"] = range(self.count)
        return made

    @property
    def labels(self) -> tuple[str, ...]:
        """The columns of the points: "case" first where there are several, then all variables in order."""
        cases = ("case",) if len(self.questions) > 1 else ()
        return (*cases, *(variable.label for variable in self.variables))

    def __len__(self) -> int:
        return math.prod(map(len, self.axes.values()))

    @cached_property
    def key(self) -> str:
        """The sha256 of all that points and answers follow from: all but title, note and budget, and what is read."""
        followed = {
            "version": __version__,
            "cases": [[question.drawn().scene.key, question.case] for question in self.questions],
            "vary": [variable.to_dict() for variable in self.variables],
            "files": self._files,
            **{key: getattr(self, key) for key in (*_SETTINGS, "parameters", "derive")},
        }
        return digest(canonical(followed))

    @property
    def _files(self) -> dict[str, str]:
        """The sha256 of each mesh file among the values."""
        named = [
            (given, str(located(given, Path(self.folder or ""))))
            for variable in self.variables
            for value in (() if variable.drawn else variable.values)
            for key, own in variable.at(value).items()
            if (given := _mesh_file(parse(key), own)) is not None
        ]
        return {
            given: hashlib.sha256(Path(path).read_bytes()).hexdigest() for given, path in named if Path(path).is_file()
        }

    @cached_property
    def unit(self) -> str:
        """Unit of all lengths and amounts, "" where the cases name none or have different ones."""
        units = {
            "" if isinstance(question.case.get("amount"), Mapping) else question.scene.unit
            for question in self.questions
        }
        varied = any("unit" in place for variable in self.variables for place in variable.places)
        return units.pop() if len(units) == 1 and not varied else ""

    def to_dict(self) -> dict[str, Any]:
        """Return the definition as plain data, without the problem."""
        axes = {
            label: plain_value(list(values)) if label != "draw" else len(values) for label, values in self.axes.items()
        }
        keys = ("title", "note", *_SETTINGS, "budget")
        return {
            **({"unit": self.unit} if self.unit else {}),
            **{key: plain_value(getattr(self, key)) for key in keys},
            "labels": list(self.labels),
            "axes": axes,
            "vary": [variable.to_dict() for variable in self.variables],
            "parameters": self.parameters,
            "derive": self.derive,
        }

    def __repr__(self) -> str:
        sizes = " x ".join(f"{len(values)} {label}" for label, values in self.axes.items()) or "1 point"
        return f"Study({self.title + ': ' if self.title else ''}{sizes})"

    # ----------------------------------------------------------------------------------------------------- points

    def points(self) -> Iterator[StudyPoint]:
        """Return all points in order; each is made when it is asked for."""
        return map(self.point, range(len(self)))

    def point(self, number: int) -> StudyPoint:
        """Return one point."""
        base, chosen = self._chosen(number)
        values = {
            variable.label: variable.names[k] if variable.names else self.value(variable, k)
            for variable, k in chosen.items()
        }
        if len(self.questions) > 1:
            values = {"case": base.name, **values}
        try:
            question = self.question_at(base, chosen).drawn()
            case = canonical({key: value for key, value in question.case.items() if key != "name"})
            scene = question.scene.key
        except InputError as reason:
            text = canonical({"version": __version__, "study": self.key, "values": values})
            return StudyPoint(number, digest(text), values, None, str(reason))
        certify = "true" if self.certify else "false"
        how = f'"certify":{certify},"effort":"{self.effort}"'
        text = f'{{"case":{case},{how},"scene":"{scene}","version":"{__version__}"}}'
        return StudyPoint(number, digest(text), values, question)

    def _chosen(self, number: int) -> tuple[Question, dict[Variable, int]]:
        """Return the case of a point, and which value each variable takes there."""
        if not 0 <= number < len(self):
            raise InputError("no such point", key="number", found=number, allowed=f"0 to {len(self) - 1}")
        rest, draw = divmod(number, self.count or 1)
        chosen: dict[Variable, int] = {}
        for variable in reversed(self.variables):
            if variable.drawn:
                chosen[variable] = draw
            else:
                rest, chosen[variable] = divmod(rest, len(variable.values))
        return self.questions[rest], {variable: chosen[variable] for variable in self.variables}

    def value(self, variable: Variable, k: int) -> Any:
        """Return the k-th value of a variable, listed or drawn, from 0."""
        return float(self._draws[variable][k]) if variable.drawn else variable.values[k]

    def question_at(self, base: Question, chosen: Mapping[Variable, int]) -> Question:
        """Return the question where each variable takes its k-th value."""
        places: dict[str, Any] = {}
        parameters: dict[str, float] = {}
        for variable, k in chosen.items():
            given = variable.at(self.value(variable, k)).items()
            for place, (key, own) in zip(variable.places, given, strict=True):
                if place[0] == PARAMETERS:
                    parameters[str(place[1])] = float(own)
                else:
                    places[key] = own
        places |= self.derivation.at(parameters)
        for key, value in places.items():
            file = _mesh_file(parse(key), value)
            if file is not None:
                path = located(file, Path(self.folder or ""))
                places[key] = path if isinstance(value, str) else {**value, "file": path}
        return base.changed(places)


_SETTINGS = ("sampling", "count", "seed", "certify", "effort", "time_limit")


def _questions(problem: Any) -> tuple[Question, ...]:
    if isinstance(problem, str | os.PathLike):
        return Question.read(problem)
    given = problem if isinstance(problem, list | tuple) else (problem,)
    if not given or not all(isinstance(item, Scene | Question) for item in given):
        allowed = "the path of a problem file, a Problem or an Assembly, or a list of them"
        raise InputError("nothing to study", key="problem", found=problem, allowed=allowed)
    return tuple(item if isinstance(item, Question) else Question.of(item) for item in given)


def _mesh_file(place: Place, value: Any) -> str | None:
    """Return the mesh file that a value at a place names: itself, or in the table of a body."""
    if place[0] not in ("bodies", "part", "keep_out"):
        return None
    file = value if place[-1] == "file" else value.get("file") if isinstance(value, Mapping) else None
    return file if isinstance(file, str) else None


# ---------------------------------------------------------------------------------------------------- what is refused


def _check_keys(study: Study) -> None:
    """Refuse keys and labels that are given twice, and keys of which one lies inside another."""
    given = _places(study)
    for where, key in given:
        with placed(key=where):
            place = parse(key)
        if where.startswith("derive") and place[0] == PARAMETERS:
            allowed = f"the expression itself as a value in {PARAMETERS}"
            raise InputError("a parameter is not derived", key=where, found=key, allowed=allowed)
        if place[0] == PARAMETERS and not (len(place) == 2 and isinstance(place[1], str)):
            raise InputError("not a parameter", key=where, found=key, allowed=f"{PARAMETERS}.name")
        if place[0] == "name":
            raise InputError("the name of a case does not vary", key=where, found=key, allowed="other keys")
    for (one, first), (two, second) in combinations(given, 2):
        if overlap(_without_units(parse(first)), _without_units(parse(second))):
            what = "a key is given twice" if first == second else "two keys say the same"
            raise InputError(what, key=two, found=f"{second}, and {first} in {one}", allowed="each key once")
    names: dict[str, str] = {}
    for variable in study.variables:
        label, where = variable.label, f"{variable.where}.label"
        if label in RESERVED:
            raise InputError("this label has a meaning in tables", key=where, found=label, allowed="another label")
        if names.setdefault(label, variable.where) != variable.where:
            allowed = "a label of its own"
            raise InputError(f"the label is that of {names[label]}", key=where, found=label, allowed=allowed)


def _check_values(study: Study, base: Question) -> None:
    """Refuse keys and listed values that make no question from `base`, whatever the others are."""
    first = dict.fromkeys(study.variables, 0)
    try:
        question = study.question_at(base, first)
        question.check()
        question.drawn()
    except InputError as reason:
        raise _placed(reason, study) from reason
    given = [key for key in ("target", "requirement", "tolerance") if key in question.case]
    if given[:1] == ["target"] and len(given) > 1:
        allowed = "target, or requirement and tolerance"
        raise InputError("these keys exclude each other", key="vary", found=" and ".join(given), allowed=allowed)
    for variable in study.variables:
        for k in [] if variable.drawn else _telling(variable.values):
            try:
                study.question_at(base, {**first, variable: k}).check()
            except InputError as reason:
                if not _of_derivation(reason):
                    raise _wrong(reason, f"{variable.listed}[{k + 1}]") from reason


def _places(study: Study) -> list[tuple[str, str]]:
    """Return where each key is given, and the key."""
    varied = [(variable.where, key) for variable in study.variables for key in variable.keys]
    return varied + [(f"derive.'{key}'", key) for key in study.derive]


def _placed(reason: InputError, study: Study) -> InputError:
    """Return what is wrong with the first point as an error of the variable or derived key that it comes from."""
    places = _places(study)
    if reason.key is None or _of_derivation(reason) or not places:
        return reason
    inner = study.derive.get(reason.key)
    if isinstance(inner, Mapping):  # of a key with dots that is not in quotes TOML makes tables
        reason = InputError(reason.what, key=reason.key, allowed=f'"{_dotted(reason.key, inner)}" = ..., in quotes')
    for where, key in places:
        with suppress(InputError):  # some keys of errors are no places
            if overlap(parse(reason.key), parse(key)):
                return _wrong(reason, where)
    what = f"the first point makes no question: {reason.key}: {reason.what}"
    return InputError(what, key="vary", found=reason.found, allowed=reason.allowed, file=reason.file)


def _dotted(key: str, value: Any) -> str:
    """Return the key with dots that tables of one key each are written with."""
    while isinstance(value, Mapping) and len(value) == 1:
        ((inner, value),) = value.items()
        key = f"{key}.{inner}"
    return key


def _without_units(place: Place) -> Place:
    """Return a place in which keys that exclude each other as units do are one."""
    head = "names of keep-outs" if place == ("keep_out",) else place[0]  # which count in a case, not their bodies
    return (head, *(min([item, *excluded(item)]) if isinstance(item, str) else item for item in place[1:]))


def _of_derivation(reason: InputError) -> bool:
    """Tell whether an expression had no value, as it may at one point and not at others."""
    return reason.key == PARAMETERS or (reason.key or "").startswith((f"{PARAMETERS}.", "derive."))


def _telling(values: Sequence[Any]) -> list[int]:
    """Return which of the listed values to check: those that differ in more than finite numbers."""
    first: dict[Any, int] = {}
    for k, value in enumerate(values):
        first.setdefault(_shape(value), k)
    return list(first.values())


def _shape(value: Any) -> Any:
    """Return a value with all floats alike."""
    if isinstance(value, float):
        return float
    return tuple(map(_shape, value)) if isinstance(value, list) else canonical(value)


def _wrong(reason: InputError, where: str) -> InputError:
    what = f"no problem takes this: {reason.key}: {reason.what}" if reason.key else reason.what
    return InputError(what, key=where, found=reason.found, allowed=reason.allowed, file=reason.file)
