"""The JSON Schemas of problem and study files, and the pages that are written from what the code says of itself."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer
from jsonschema import Draft7Validator, Draft202012Validator

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.design.study.schema import StudyFile, json_schema
from fcdm_opt.errors import InputError
from fcdm_opt.problem.assembly_file import AssemblyFile
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.schema import checked

HOME = Path(__file__).parents[2]
PROBLEMS = sorted((HOME / "problems").glob("*.toml"))
STUDIES = sorted((HOME / "problems" / "studies").glob("*.toml"))
ASSEMBLIES = sorted((HOME / "problems" / "assemblies").glob("*.toml"))
MODELS: dict[str, Any] = {"problem": ProblemFile, "study": StudyFile, "assembly": AssemblyFile}
DRAFTS = (Draft7Validator, Draft202012Validator)  # editors read one or the other
UNITS = r"length|degree|radian|relative|scale|second|whole number|label|amount|unit|vector|_deg|its own"
CASE = {"name": "A", "target": [1.0, 1.0], "motion": [{"translation": "z"}]}
BODY = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]}
BODIES = {"movable": BODY, "static": {**BODY, "seed": [3.0, 0.0, 0.0]}}


@cache
def schema(kind: str) -> dict[str, Any]:
    return MODELS[kind].model_json_schema()


@cache
def tables(kind: str) -> dict[str, dict[str, Any]]:
    return {"": schema(kind), **schema(kind)["$defs"]}


def accepted(kind: str, data: Any) -> list[bool]:
    return [draft(schema(kind)).is_valid(data) for draft in DRAFTS]


def keys(kind: str) -> list[tuple[str, str, dict[str, Any]]]:
    return [(name, key, item) for name, table in tables(kind).items() for key, item in table["properties"].items()]


@cache
def hook(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, HOME / "docs" / "hooks" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# -------------------------------------------------------------------------------------------------------------- schemas


@pytest.mark.parametrize("kind", MODELS)
def test_schemas_are_valid_in_both_drafts_and_say_what_every_table_and_key_is(kind):
    for draft in DRAFTS:
        draft.check_schema(schema(kind))
    for name, table in tables(kind).items():
        assert table["additionalProperties"] is False, name
        assert re.fullmatch(r"[A-Z][a-z]*([ -][a-z]+)*", table["title"]), name  # in words
        assert len(table["description"]) > 10, name
    for name, key, item in keys(kind):
        place = f"{name}.{key}"
        assert len(item["description"]) > 5, place
        assert item.get("examples") or key == "casadi", place
        if "'type': 'number'" in str(item):
            assert re.search(UNITS, item["description"]), place


@pytest.mark.parametrize("kind", MODELS)
def test_examples_and_defaults_are_what_the_schema_allows(kind):
    definitions = {"$defs": schema(kind)["$defs"]}
    found = 0
    for name, key, item in keys(kind):
        values = [*item.get("examples", ()), *([item["default"]] if "default" in item else [])]
        for value in values:
            for draft in DRAFTS:
                wrong = [error.message for error in draft({**item, **definitions}).iter_errors(value)]
                # an example of a table inside may show few of its keys
                assert not [text for text in wrong if "required" not in text], (name, key, value)
        found += len(values)
    assert found >= len(keys(kind)) - 2


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda path: path.stem)
def test_every_problem_file_is_accepted(path):
    assert accepted("problem", tomllib.loads(path.read_text("utf-8"))) == [True, True]


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_study_file_is_accepted(path):
    assert accepted("study", tomllib.loads(path.read_text("utf-8"))) == [True, True]


@pytest.mark.parametrize("path", ASSEMBLIES, ids=lambda path: path.stem)
def test_every_file_of_an_assembly_is_accepted(path):
    assert accepted("assembly", tomllib.loads(path.read_text("utf-8"))) == [True, True]


def problem(**keys: Any) -> dict[str, Any]:
    return {"bodies": BODIES, "case": [{**CASE, **keys}]}


WRONG_PROBLEMS: dict[str, dict[str, Any]] = {
    "no bodies": {"case": [CASE]},
    "a body of nothing": {"bodies": {**BODIES, "static": {"seed": "box"}}, "case": [CASE]},
    "a body of file and vertices": {
        "bodies": {**BODIES, "static": {**BODY, "file": "peg.stl", "unit": "mm"}},
        "case": [CASE],
    },
    "a file without unit": {"bodies": {**BODIES, "static": {"file": "peg.stl"}}, "case": [CASE]},
    "an unknown unit": {"bodies": {**BODIES, "static": {"file": "peg.stl", "unit": "yd"}}, "case": [CASE]},
    "an unknown table": {**problem(), "cases": []},
    "an unknown key": problem(tolerence=0.02),
    "no name": {"bodies": BODIES, "case": [{"target": [1.0, 1.0], "motion": [{"translation": "z"}]}]},
    "a goal that does not exist": problem(goal="near"),
    "a requirement that does not exist": problem(requirement="E"),
    "a state that does not exist": problem(pair="apart"),
    "a path that does not exist": problem(path="short"),
    "an amount that does not exist": problem(amount="heavy"),
    "a triple of scales": problem(target=[1.0, 1.0, 1.0]),
    "a number as text": problem(clearance="0.1"),
    "a switching point 0": problem(nominal=0),
    "no steps": problem(motion=[]),
    "an unknown step": problem(motion=[{"shift": "z"}]),
    "two steps in one": problem(motion=[{"translation": "z", "rotation": "z"}]),
    "a rotation without centre": problem(motion=[{"rotation": "z"}]),
    "an axis w": problem(motion=[{"translation": "w"}]),
    "a screw with no pitch": problem(motion=[{"screw": "seeds"}]),
    "a screw with two pitches": problem(motion=[{"screw": "seeds", "pitch": "free", "pitch_per_deg": 1.0}]),
    "a limit in words": problem(limits={"TZ": ["low", 1.0]}),
}


@pytest.mark.parametrize("name", WRONG_PROBLEMS)
def test_the_schema_refuses_what_reading_refuses(name):
    assert accepted("problem", WRONG_PROBLEMS[name]) == [False, False]
    with pytest.raises(InputError):
        checked(ProblemFile, WRONG_PROBLEMS[name]).problems(fo.Problem)


@pytest.mark.parametrize(
    "own",
    [
        {"motion": [{"screw": {"point": [0, 0, 0], "direction": [0, 0, 1]}, "pitch": "free"}]},
        {"motion": [{"rotation": [0, 0, 1], "centre": [0, 0, 1]}], "limits": {"R1_deg": [-10, "inf"]}},
        {"motion": [{"free": True}], "weights": {"RX_per_deg": 2.0}, "length": 2},
        {"target": None, "tolerance": [[0.0, 0.02], [0.01, 0.01]], "requirement": "C", "nominal": [1.0, 1.0]},
        {"resolution": 0.01, "clearance": 0.1, "goal": "clear"},
    ],
)
def test_the_schema_accepts_what_reading_accepts(own):
    case = {key: value for key, value in {**CASE, **own}.items() if value is not None}
    made = {"bodies": BODIES, "case": [case]}
    if "limits" in own:  # the name of a parameter about a slanted axis is told by the motion
        turn = fo.Rotation((0.0, 0.0, 1.0), centre=(0.0, 0.0, 1.0)).parameters[0].name
        case["limits"] = {f"{turn}_deg": own["limits"]["R1_deg"]}
    assert accepted("problem", made) == [True, True]
    assert checked(ProblemFile, made).problems(fo.Problem)


@pytest.mark.parametrize(
    "vary",
    [
        {"key": "tolerance"},
        {"key": "tolerance", "values": []},
        {"key": "tolerance", "values": [0.1], "grid": {"from": 0.0, "to": 1.0, "count": 2}},
        {"key": "tolerance", "grid": {"from": 0.0, "to": 1.0}},
        {"key": "tolerance", "csv": {"file": "a.csv"}},
        {"key": "tolerance", "csv": {"file": "a.csv", "column": "a", "columns": ["a", "b"]}},
        {"keys": "tolerance", "values": [0.1]},
    ],
)
def test_the_study_schema_refuses_what_reading_refuses(vary):
    study = {"problem": "../boxes.toml", "vary": [vary]}
    assert accepted("study", study) == [False, False]
    with pytest.raises(InputError):
        checked(StudyFile, study)


@pytest.mark.parametrize("kind", MODELS)
def test_what_the_command_prints_is_what_the_pages_are_written_from(kind):
    printed = json_schema(kind)
    assert {key: printed[key] for key in schema(kind) if key != "title"} == {
        key: item for key, item in schema(kind).items() if key != "title"
    }


# ---------------------------------------------------------------------------------------------------------------- pages


@pytest.mark.parametrize(
    ("kind", "page"), [("problem", "problem-file.md"), ("study", "studies.md"), ("assembly", "assemblies.md")]
)
def test_the_page_of_a_file_names_every_table_and_key(kind, page):
    own, first = ((HOME / "docs" / name).read_text("utf-8") for name in (page, "problem-file.md"))
    written = own if kind == "study" else own + first  # what assemblies share with problems is written there
    for table in tables(kind).values():
        assert f"## {table['title']}\n" in written
        assert table["description"].rstrip(".") in written
    for _, key, item in keys(kind):
        rows = [line for line in written.splitlines() if line.startswith(f"| `{key}` |")]
        assert rows, key
        assert any(row.count(" | ") == 2 for row in rows), key
        for example in item.get("examples", ()):
            assert f"`{key} = {hook('problem_file')._toml(example)}`" in written
    for text, link in ((own, r"\]\(#([^)]+)\)"), (first, r"\]\(problem-file\.md#([^)]+)\)")):
        anchors = {title.lower().replace(" ", "-") for title in re.findall(r"^#+ (.+)$", text, re.M)}
        assert set(re.findall(link, own)) <= anchors


def test_whole_files_on_the_page_are_read(tmp_path):
    blocks = re.findall(r"```toml\n(.*?)```", (HOME / "docs" / "problem-file.md").read_text("utf-8"), re.S)
    whole = [text for text in blocks if "[[case]]" in text]
    assert whole
    for text in whole:
        data = tomllib.loads(text)
        assert accepted("problem", data) == [True, True]
        assert checked(ProblemFile, data).problems(fo.Problem, HOME / "problems" / "page.toml")


def test_the_page_of_the_command_line_has_every_command_and_option():
    written = (HOME / "docs" / "command-line.md").read_text("utf-8")
    program: Any = typer.main.get_command(app)
    assert len(program.commands) > 8
    for name in program.commands:
        command = program.commands[name].make_context(name, [], resilient_parsing=True).command
        head, section = f"## fcdm-opt {name}\n", ""
        assert head in written
        section = written.split(head)[1].split("\n## ")[0]
        for own in (own for own in command.params if not getattr(own, "hidden", False)):
            for spelling in (*own.opts, *own.secondary_opts) if own.param_type_name == "option" else ():
                assert re.search(rf"(\| `|, | / ){spelling}\b", section), (name, spelling)
            assert own.help, (name, own.name)
        assert command.help


def test_the_page_of_the_api_names_everything_public():
    pages = sorted((HOME / "docs" / "api").glob("*.md"))
    text, listed = "\n".join(page.read_text("utf-8") for page in pages), (HOME / "docs" / "api.md").read_text("utf-8")
    named = re.findall(r"^::: (\S+)", text, re.M)
    assert len(named) == len(set(named))
    assert {name.rsplit(".", 1)[1] for name in named} >= set(fo.__all__) - {"__version__"}
    assert {f"`{name.rsplit('.', 1)[1]}`" for name in named} == set(re.findall(r"`\w+`", listed.split("|---|")[1]))
    assert all(f"(api/{page.name})" in listed for page in pages)
    for name in named:  # where they are said to be
        module, _, own = name.rpartition(".")
        found = getattr(importlib.import_module(module), own)
        if own in fo.__all__:
            assert found is getattr(fo, own)
