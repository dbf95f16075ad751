"""A study: one problem, or several cases of it, with some of its keys varied."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from fcdm_opt.design.places import Place, parse
from fcdm_opt.design.question import Question, canonical, digest, located, plain_value
from fcdm_opt.design.study.checking import check_draws, check_keys, check_values
from fcdm_opt.design.study.derivation import Derivation
from fcdm_opt.design.study.schema import StudyArguments, StudyFile, YieldEntry
from fcdm_opt.design.study.variables import MOST, PARAMETERS, Variable, shares, variable_of
from fcdm_opt.errors import InputError, placed
from fcdm_opt.problem.arguments import items
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.schema import checked, closest, read_entry
from fcdm_opt.version import __version__

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


@dataclass(frozen=True, eq=False)
class Study:
    """A problem with some of its keys varied: every combination of the listed values, times the draws.

    Nothing is solved here: see `run_study`. All keys and listed values are checked when a study is made; values that
    only fail together, or for the bodies as they come out, make a point with an error.

    Parameters
    ----------
    problem : path, Problem, Question, or a sequence of problems or questions
        What is varied; a problem file with all its cases.
    vary : mapping of key to values, or sequence of Variable
        A key is a place such as "tolerance", "target[1]", "limits.RZ_deg", `bodies.movable.vertices[5][3]` or
        "parameters.draft_deg", or a tuple of such keys that vary together. Values: a list (with several keys, of
        lists), a mapping of names to values, or `Uniform`, `Normal`, `Measured`. None stands for the default.
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
    parameters: Mapping[str, Any] | None = None
    derive: Mapping[str, Any] | None = None
    cases: Sequence[str] | None = None
    sampling: str = "latin hypercube"
    count: int | None = None
    seed: int = 1
    certify: bool = False
    effort: str = "proved"
    time_limit: float | None = None
    budget: float | None = None
    title: str = ""
    note: str = ""
    folder: Any = None

    def __post_init__(self) -> None:
        self._check_arguments()
        derived = self.derive or {}
        check_keys(self.variables, derived)
        check_draws(self.variables, self.count, len(self))
        for base in self.questions:
            check_values(self.variables, derived, self.question_at, base)

    def _check_arguments(self) -> None:
        """Refuse arguments of the wrong kind, in the words of a study file; keep plain values."""
        given = {key: plain_value(getattr(self, key)) for key in StudyArguments.model_fields}
        plain = dict(checked(StudyArguments, given))
        if self.budget is not None:
            plain |= dict(checked(YieldEntry, {"budget": plain_value(self.budget)}))
        for key, value in plain.items():
            object.__setattr__(self, key, value)
        if self.count is not None and self.count > MOST:
            raise InputError("too many draws", key="count", found=self.count, allowed=f"at most {MOST}")
        if self.certify and self.effort == "quick":
            raise InputError(
                "a quick search proves nothing", key="effort", found="quick", allowed="proved, with certify"
            )
        for key in ("parameters", "derive"):
            table = getattr(self, key)
            if table is not None and not (isinstance(table, Mapping) and all(isinstance(name, str) for name in table)):
                raise InputError("expected a table", key=key, found=table, allowed="names or keys with their values")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Study:
        """Return the study of a file (TOML); paths in it start from its folder.

        Raises
        ------
        InputError
            Names the file, the key, what was found and what is allowed.
        """
        path = Path(path)
        file: Any = read_entry(StudyFile, path, "study file", "problem and [[vary]]")
        budget = getattr(file, "yield")
        with placed(file=path):
            return cls(
                located(file.problem, path.parent),
                [variable_of(entry, f"vary[{k}]", path.parent) for k, entry in enumerate(file.vary, 1)],
                **{key: getattr(file, key) for key in _SAME_IN_FILES},
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
                    raise InputError(what, key=f"cases[{k}]", found=name, allowed=", ".join(names))
            found = tuple(found[names.index(name)] for name in chosen)
        return tuple(
            replace(question, case={key: value for key, value in question.case.items() if key not in _REFERENCES})
            for question in found
        )

    @cached_property
    def derivation(self) -> Derivation:
        """What follows from parameters."""
        varied = {str(place[1]) for variable in self.variables for place in variable.places if place[0] == PARAMETERS}
        derive = {key: plain_value(value) for key, value in (self.derive or {}).items()}
        return Derivation.of(self.parameters or {}, derive, varied)

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
    def version(self) -> str:
        """Version of the package, a part of all keys."""
        return __version__

    @cached_property
    def key(self) -> str:
        """The sha256 of all that points and answers follow from: all but title, note and budget, and what is read."""
        return digest(
            canonical(
                {
                    "version": self.version,
                    "cases": [[question.drawn().scene.key, question.case] for question in self.questions],
                    "vary": [variable.to_dict() for variable in self.variables],
                    "files": self._files,
                    **{key: plain_value(getattr(self, key) or {}) for key in ("parameters", "derive")},
                    **{key: getattr(self, key) for key in _TOLD},
                }
            )
        )

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
        keys = ("title", "note", *_TOLD, "budget")
        return {
            **({"unit": self.unit} if self.unit else {}),
            **{key: plain_value(getattr(self, key)) for key in keys},
            "labels": list(self.labels),
            "axes": axes,
            "vary": [variable.to_dict() for variable in self.variables],
            "parameters": plain_value(self.parameters or {}),
            "derive": plain_value(self.derive or {}),
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
            told = canonical({"version": self.version, "study": self.key, "values": values})
            return StudyPoint(number, digest(told), values, None, str(reason))
        certify = "true" if self.certify else "false"
        how = f'"certify":{certify},"effort":"{self.effort}"'
        told = f'{{"case":{case},{how},"scene":"{scene}","version":"{self.version}"}}'
        return StudyPoint(number, digest(told), values, question)

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


_TOLD = ("sampling", "count", "seed", "certify", "effort", "time_limit")
_SAME_IN_FILES = (
    "title", "note", "cases", "seed", "certify", "effort", "time_limit", "sampling", "count", "parameters", "derive",
)  # fmt: skip


def _questions(problem: Any) -> tuple[Question, ...]:
    """Return what a study starts from as questions."""
    if isinstance(problem, str | os.PathLike):
        return Question.read(problem)
    given = problem if isinstance(problem, list | tuple) else (problem,)
    if not given or not all(isinstance(item, Problem | Question) for item in given):
        allowed = "the path of a problem file, a Problem, or a list of problems"
        raise InputError("nothing to study", key="problem", found=problem, allowed=allowed)
    return tuple(item if isinstance(item, Question) else Question.of(item) for item in given)


def _mesh_file(place: Place, value: Any) -> str | None:
    """Return the mesh file that a value at a place names: itself, or in the table of a body."""
    if place[0] not in ("bodies", "keep_out"):
        return None
    file = value if place[-1] == "file" else value.get("file") if isinstance(value, Mapping) else None
    return file if isinstance(file, str) else None
