"""What a study file, or `Study`, may hold; the descriptions of the fields are the format's documentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field, create_model, model_validator

from fcdm_opt.errors import known_word
from fcdm_opt.plain import schema_of
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly_file import AssemblyFile
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.schema import Entry, Label, Number, declared, one_of, refusal
from fcdm_opt.problem.solution import Effort, Solution

Key = Annotated[str, Field(min_length=1)]
Sampling = Literal["latin hypercube", "random"]
DIALECT = "https://json-schema.org/draft/2020-12/schema"  # the name of the dialect: nothing is asked there
KINDS = ("problem", "study", "assembly", "result")
SOURCES = ("values", "grid", "uniform", "normal", "csv")

# "from" and "yield" are words of Python, so that no class body can name such a field
GridEntry = create_model(
    "Grid",
    __base__=Entry,
    __doc__="Evenly spaced numbers, both ends among them.",
    **{
        "from": (Number, declared(..., "the first number, in the key's unit", 0.001)),
        "to": (Number, declared(..., "the last number, above the first, in the key's unit", 0.05)),
        "count": (Label, declared(..., "how many, a whole number >= 1; with 1 from and to are equal", 50)),
        "spacing": (
            Literal["linear", "log"],
            declared("linear", '"linear", or "log": equal ratios between numbers > 0', "log"),
        ),
    },  # type: ignore[call-overload]
)


class UniformEntry(Entry, title="Uniform"):
    """Numbers drawn evenly between two ends."""

    low: Number = declared(..., "least number that is drawn, in the key's unit", 0.98)
    high: Number = declared(..., "largest number that is drawn, above low, in the key's unit", 1.02)


class NormalEntry(Entry, title="Normal"):
    """Numbers drawn from a normal distribution that is cut off at both ends."""

    mean: Number = declared(..., "mean before the cut, in the key's unit", 1.0)
    deviation: Number = declared(..., "standard deviation > 0 before the cut, in the key's unit", 0.005)
    low: Number = declared(..., "least number that is drawn, in the key's unit", 0.98)
    high: Number = declared(..., "largest number that is drawn, above low, in the key's unit", 1.02)


class CsvEntry(Entry, title="Measured values", json_schema_extra=one_of(("column",), ("columns",))):
    """Measured values: one column to draw from, or several whose rows are taken as they are."""

    file: str = declared(..., "path of a CSV file with a line of column names, relative to this file", "sizes.csv")
    column: str | None = declared(None, "name of the column to draw from", "peg")
    nominal: Number | None = declared(
        None, "number that the values of the column are divided by, in their unit; without it 1", 10.0
    )
    columns: list[str] | None = declared(None, "names of columns, one a key", ["peg", "hole"], min_length=1)
    nominals: list[Number] | None = declared(
        None, "numbers that they are divided by, one a column, in their units; without it 1", [10.0, 10.2]
    )

    @model_validator(mode="after")
    def _exactly_one_key(self) -> Self:
        if (self.column is None) == (self.columns is None):
            found = "neither" if self.column is None else "both"
            raise refusal("exactly one of column and columns must be given", found=found, allowed="column or columns")
        stray, other = ("nominals", "columns") if self.columns is None else ("nominal", "column")
        if getattr(self, stray) is not None:
            raise refusal(f"this key goes with {other}", found=getattr(self, stray), allowed=other, inside=(stray,))
        return self


class VaryEntry(Entry, title="What varies", json_schema_extra=one_of(*((source,) for source in SOURCES))):
    """One variable of a study: which key takes which values."""

    key: Key | Annotated[list[Key], Field(min_length=1)] = declared(
        ...,
        'a key of a problem ("tolerance", "target[1]", "limits.RZ_deg", "bodies.movable.vertices[5][3]", '
        '"parameters.draft_deg"), or a list of keys that vary together',
        "tolerance",
        ["requirement", "goal"],
    )
    label: Annotated[str, Field(min_length=1)] | None = declared(
        None, "name of its column in the results (text)", "size tolerance"
    )
    values: Annotated[list[Any], Field(min_length=1)] | None = declared(
        None,
        "[...], at least one value; with several keys one list a point: [[...], [...]]",
        [0.01, 0.02],
        [["A", "beyond"], ["B", "touch"]],
    )
    names: list[str] | None = declared(
        None, 'names of the listed values in the results, all different: ["TX", "TZ + RZ"]', ["fine", "coarse"]
    )
    grid: GridEntry | None = declared(  # type: ignore[valid-type]
        None,
        '{ from = 0.001, to = 0.05, count = 50, spacing = "linear" or "log" }',
        {"from": 0.001, "to": 0.05, "count": 50, "spacing": "log"},
    )
    uniform: UniformEntry | None = declared(None, "{ low = 0.98, high = 1.02 }", {"low": 0.98, "high": 1.02})
    normal: NormalEntry | None = declared(
        None,
        "{ mean = 1.0, deviation = 0.005, low = 0.98, high = 1.02 }, cut off at low and high",
        {"mean": 1.0, "deviation": 0.005, "low": 0.98, "high": 1.02},
    )
    csv: CsvEntry | None = declared(
        None,
        '{ file = "sizes.csv", column = "peg", nominal = 10.0 }, or columns = [...] with several keys',
        {"file": "sizes.csv", "column": "peg", "nominal": 10.0},
    )

    @model_validator(mode="after")
    def _exactly_one_key(self) -> Self:
        given = [source for source in SOURCES if getattr(self, source) is not None]
        if len(given) != 1:
            allowed = f"exactly one of {', '.join(SOURCES)}"
            raise refusal("the values are not given once", found=", ".join(given) or "none", allowed=allowed)
        return self


class YieldEntry(Entry, title="Yield"):
    """What counts as good."""

    budget: Annotated[Number, Field(ge=0.0)] = declared(
        ..., "largest amount >= 0 of a motion that is affordable, length units", 0.25
    )


class StudyArguments(Entry):
    """What `Study` takes in Python as it stands in a file."""

    title: str = declared("", "title (text)", "Draft angle")
    note: str = declared("", "what the reader should know (text)", "Lengths in mm.")
    cases: Annotated[list[str], Field(min_length=1)] | None = declared(
        None, 'names of the cases to take: ["A", "B"]; without it all', ["A", "B"]
    )
    seed: Annotated[int, Field(strict=True, ge=0)] = declared(1, "whole number >= 0 that the draws follow from", 1)
    certify: Annotated[bool, Field(strict=True)] = declared(False, "true: prove that no smaller motion will do", True)
    effort: Effort = declared(
        "proved",
        '"proved": every motion with a bound of how small it can be; "quick": the first that the stages '
        "find, without proof, for many points",
        "quick",
    )
    time_limit: Annotated[Number, Field(gt=0.0)] | None = declared(None, "seconds > 0 a point", 60.0)
    sampling: Sampling = declared("latin hypercube", '"latin hypercube" or "random": how numbers are drawn', "random")
    count: Label | None = declared(None, "how many draws >= 1, goes with uniform, normal or csv column", 1000)
    parameters: dict[str, Number | str] = declared(
        {}, "{ draft_deg = 1.0 }: numbers of one's own, or expressions in them", {"draft_deg": 1.0}
    )
    derive: dict[str, Any] = declared(
        {},
        '{ target = ["r", "1.0"] }: values of keys, texts in them are expressions in parameters',
        {"limits": {"TX": ["-draft_deg", "draft_deg"]}},
    )


class _StudyFile(StudyArguments, title="Study file"):
    """A whole study file: a problem file, and what varies of it."""

    problem: str = declared(
        ..., 'path of the problem file, relative to this file: "../example1.toml"', "../peg_square.toml"
    )
    vary: list[VaryEntry] = declared(
        [],
        "[[vary]] tables, one a variable: which key takes which values",
        [{"key": "tolerance", "values": [0.01, 0.02]}],
    )


_YIELD = declared(None, "{ budget = 0.25 }: tell the share of points whose amount stays within it", {"budget": 0.25})
StudyFile = create_model(
    "StudyFile",
    __base__=_StudyFile,
    __doc__=_StudyFile.__doc__,
    **{"yield": (YieldEntry | None, _YIELD)},  # type: ignore[call-overload]
)


def json_schema(kind: str = "problem") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a kind of file; editors complete and check files by it.

    Of a "problem", "study" or "assembly", or a "result": what `fcdm-opt solve --json` writes. Raises `InputError` for
    another kind.
    """
    known_word(kind, KINDS, "no such kind of file", key="--what")
    if kind == "result":
        return result_schema("solve", {"": (Solution, AssemblySolution)})
    document = {"problem": ProblemFile, "study": StudyFile, "assembly": AssemblyFile}[kind].model_json_schema()
    document.pop("title", None)
    head = {"$schema": DIALECT, "$id": f"urn:fcdm-opt:{kind}", "title": f"{kind.capitalize()} file of fcdm-opt (TOML)"}
    return {**head, **document}


def result_schema(command: str, answers: Mapping[str, Sequence[Any]], about: str = "case") -> dict[str, Any]:
    """Return the schema of a document of a command: files, their cases, and for each what its answers tell.

    `answers` has of which class what stands under a key of a case is; under "" what the case itself is. `about` tells
    whether these keys are of each "case", of each "file" or of the "document".
    """
    known: dict[str, Any] = {}
    under = {key: {"anyOf": [schema_of(kind, known) for kind in kinds]} for key, kinds in answers.items()}
    needed = {"case": ["name"], "file": ["file"], "document": []}[about]
    failed = {"type": "object", "properties": {"error": {"type": "string"}}, "required": [*needed, "error"]}
    whole: dict[str, Any] = {"anyOf": [*under.pop("")["anyOf"], failed]} if "" in under else {}
    members_of = {own: (under, whole) if own == about else ({}, {}) for own in ("case", "file", "document")}
    case = {
        "type": "object",
        "properties": {"name": {"type": "string"}, **members_of["case"][0]},
        **members_of["case"][1],
    }
    texts = {key: {"type": "string"} for key in ("file", "title", "note", "error")}
    cases = {"cases": {"type": "array", "items": case}} if about == "case" else {}
    file = {"type": "object", "properties": {**texts, **cases, **members_of["file"][0]}, "required": ["file"]}
    return {
        "$schema": DIALECT,
        "$id": f"urn:fcdm-opt:{'' if command == 'solve' else f'{command}-'}result",
        "title": f"Result of fcdm-opt {command} --json",
        "type": "object",
        "properties": {
            "schema": {"const": f"fcdm_opt {command} 1"},
            "version": {"type": "string"},
            "error": {"type": "string"},
            "scenes": {"type": "array", "items": {"type": "object"}, "description": "bodies, by their number"},
            "files": {"type": "array", "items": file},
        },
        "required": ["schema", "version"],
        **members_of["document"][1],
        "$defs": known,
    }
