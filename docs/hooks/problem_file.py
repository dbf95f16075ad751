"""The reference of problem files, study files and files of assemblies: a section for each kind of table.

A table that problem files have too has its section there, and a link here.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from fcdm_opt.design.study.schema import StudyFile
from fcdm_opt.problem.assembly_file import AssemblyFile
from fcdm_opt.problem.keys import ProblemFile

SCHEMAS = {"problem file": ProblemFile, "study file": StudyFile, "assembly file": AssemblyFile}
FIRST, PAGE = "problem file", "problem-file.md"  # what others refer to, and where its reference is
SHARED = 3  # keys: a table with as many of another's refers to it, fewer are said again
WORDS = {"number": "number", "string": "text", "boolean": "true or false"}
Schema = Mapping[str, Any]


def reference_of(kind: str) -> str:
    """Return the reference of a kind of file, from the model that reads it."""
    shared = {} if kind == FIRST else tables_of(SCHEMAS[FIRST].model_json_schema())
    return reference(SCHEMAS[kind].model_json_schema(), {key: table for key, table in shared.items() if key != "#"})


def tables_of(schema: Schema) -> dict[str, Schema]:
    """Return the kinds of tables of a file, by the pointers that name them."""
    return {"#": schema, **{f"#/$defs/{name}": table for name, table in schema.get("$defs", {}).items()}}


def reference(schema: Schema, shared: Mapping[str, Schema]) -> str:
    """Return a section for each kind of table: its keys with type, default, meaning and an example.

    Tables that are `shared` with problem files are named as such.
    """
    own, elsewhere = tables_of(schema), {key: {**table, "page": PAGE} for key, table in shared.items()}
    tables = own | {key: elsewhere[key] for key in own if shared.get(key) == own[key]}
    tables |= {key: table for key, table in elsewhere.items() if key not in own}  # whose keys others may have
    places: dict[str, list[str]] = {}
    for place, pointer in _walk(tables, "#", ""):
        places.setdefault(pointer, []).append(place)
    sections = [_section(tables, pointer, found) for pointer, found in places.items() if "page" not in tables[pointer]]
    return "\n".join(sections)


def _walk(tables: Mapping[str, Schema], pointer: str, place: str) -> Iterator[tuple[str, str]]:
    """Yield each place of a file that a table can stand in, with the table; tables of one level together."""
    if not place:
        yield "", pointer
    inside = []
    for key, item in tables[pointer]["properties"].items():
        for steps, reference in _references(item):
            inside.append((f"{place}.{key}{steps}".removeprefix("."), reference))
    yield from inside
    for deeper, reference in inside:
        yield from _walk(tables, reference, deeper)


def _references(item: Any, steps: str = "") -> Iterator[tuple[str, str]]:
    if "$ref" in item:
        yield steps, item["$ref"]
    for choice in (*item.get("anyOf", ()), *item.get("oneOf", ())):
        yield from _references(choice, steps)
    if isinstance(item.get("items"), dict):
        yield from _references(item["items"], f"{steps}[k]")


def _section(tables: Mapping[str, Schema], pointer: str, places: list[str]) -> str:
    table = tables[pointer]
    keys, base = dict(table["properties"]), _base(tables, pointer)
    lines = ["", f"## {table['title']}", "", table["description"].rstrip(".") + ".", ""]
    if pointer != "#":
        lines += [f"Where: {', '.join(f'`{place}`' for place in places)}.", ""]
    if base:
        known = [key for key, item in keys.items() if tables[base]["properties"].get(key) == item]
        whole = len(known) == len(tables[base]["properties"])
        said = "All keys" if whole else f"The keys {', '.join(f'`{key}`' for key in known)}"
        lines += [f"{said} of {_link(tables[base])}, and:", ""]
        keys = {key: item for key, item in keys.items() if key not in known}
    lines += ["| key | value | meaning |", "|---|---|---|"]
    for key, item in keys.items():
        default = item.get("default")
        when = (
            "required" if key in table.get("required", ()) else "" if default is None else f"default `{_toml(default)}`"
        )
        value = "<br>".join(text for text in (_kind(tables, item), when) if text)
        examples = [f"`{key} = {_toml(example)}`" for example in item.get("examples", ())]
        cells = (f"`{key}`", value, "<br>".join([_sentence(item["description"]), *examples]))
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join([*lines, ""])


def _base(tables: Mapping[str, Schema], pointer: str) -> str | None:
    """Return the other kind of table all of whose keys this one has too, or of another page the most of them."""
    own, most = tables[pointer]["properties"], dict[str, tuple[int, int]]()
    for other, table in tables.items():
        count = sum(own.get(key) == item for key, item in table["properties"].items())
        if other != pointer and SHARED <= count < len(own) and ("page" in table or count == len(table["properties"])):
            most[other] = count, -len(table["properties"])
    return max(most, key=lambda other: most[other], default=None)


def _kind(tables: Mapping[str, Schema], item: Schema) -> str:
    """Return in words what values are allowed."""
    if "$ref" in item:
        return _link(tables[item["$ref"]])
    if choices := item.get("anyOf", item.get("oneOf")):
        return " or ".join(dict.fromkeys(_kind(tables, choice) for choice in choices))
    if "const" in item or "enum" in item:
        return " or ".join(f"`{_toml(value)}`" for value in item.get("enum", [item.get("const")]))
    if "prefixItems" in item:
        return f"[{', '.join(_kind(tables, own) for own in item['prefixItems'])}]"
    if item.get("type") == "array":
        one = _kind(tables, item["items"])
        return f"[{', '.join([one] * item['minItems'])}]" if item.get("maxItems") else f"list of: {one}"
    if item.get("type") == "object":
        inside = item.get("additionalProperties")
        return f"table of: {_kind(tables, inside)}" if isinstance(inside, dict) else "table"
    if item.get("type") == "integer":
        return f"whole number from {item['minimum']}" if "minimum" in item else "whole number"
    return WORDS.get(item.get("type", ""), "any value")


def _link(table: Schema) -> str:
    return f"[{table['title']}]({table.get('page', '')}#{table['title'].lower().replace(' ', '-')})"


def _sentence(text: str) -> str:
    """Return text as it stands, with signs escaped that Markdown would take for its own."""
    for sign in "<*_[]":
        text = text.replace(sign, {"<": "&lt;"}.get(sign, f"\\{sign}"))
    return text


def _toml(value: Any) -> str:
    """Return a value as it is written in a file."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_toml(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value, ensure_ascii=False)
