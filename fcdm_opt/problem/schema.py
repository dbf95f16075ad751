"""How tables of files and arguments are read: types of numbers, and what is said of a value that is none of them.

An `Entry` is a table: its fields are declared once, each with type, meaning and examples. From these come reading and
checking, the "allowed" of every message, the JSON Schema that editors complete from, and the reference pages. A place
such as `case[2] 'B'.motion[1].centre` counts from 1, as the vertex labels in a file do.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from fcdm_opt.errors import HINT, InputError, checked_path, closest, known_word, similar_name, unfit
from fcdm_opt.geometry.files import mesh_formats
from fcdm_opt.geometry.size import FIT_LETTERS
from fcdm_opt.problem.arguments import LARGEST
from fcdm_opt.problem.syntax import parsed

Read = TypeVar("Read", bound="Entry")
LARGEST_FILE = 2**26  # bytes: more than any file that is written as text; a device has no end
REFUSED = "refused"

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Label = Annotated[int, Field(strict=True, ge=1)]
Pair = tuple[Number, Number]
Point = tuple[Number, Number, Number]
Bound = Annotated[
    float,
    Field(strict=True),
    BeforeValidator(lambda end: float(end) if end in ("inf", "-inf") else end),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf"], "type": "string"}]}),
]


def refusal(what: str, *, found: Any = None, allowed: str = "", inside: tuple[Any, ...] = ()) -> PydanticCustomError:
    """Return the error that every model raises; `inside` continues the place of the model or field."""
    return PydanticCustomError(REFUSED, "{what}", {"what": what, "found": found, "allowed": allowed, "inside": inside})


def known_sizes(values: Iterable[str], key: str, names: Sequence[str]) -> None:
    """Refuse names that none of a problem's sizes has."""
    for name in values:
        known_word(name, names, "no such size", key=f"{key}.{name}")


def _words(kind: Any) -> list[str]:
    inner = get_args(kind)
    if get_origin(kind) is Literal:
        return [word for word in inner if isinstance(word, str)]
    return [word for own in inner for word in _words(own)]


def descend(value: Any, place: Iterable[Any]) -> tuple[tuple[Any, ...], Any]:
    """Follow a place that the validator reports as far as the data goes, dropping its tags."""
    kept = []
    for item in place:
        reachable = (isinstance(item, int) and isinstance(value, list | tuple) and item < len(value)) or (
            isinstance(value, Mapping) and item in value
        )
        if reachable:
            kept.append(item)
            value = value[item]
    return tuple(kept), value


def must(passes: Callable[[Any], bool], what: str, allowed: str = "") -> AfterValidator:
    """Return the check of a type; without `allowed` a refusal says what the description of the field says."""

    def check(value: Any) -> Any:
        if not passes(value):
            raise refusal(what, found=value, allowed=allowed)
        return value

    return AfterValidator(check)


def declared(default: Any, meaning: str, *examples: Any, **more: Any) -> Any:
    """Return the field of a key: its default, `...` where it must be given, what it means, and examples of values."""
    return Field(default, description=meaning, examples=list(examples) or None, **more)


Real = Annotated[Number, must(lambda x: abs(x) <= LARGEST, "unusable number")]
Positive = Annotated[Number, must(lambda x: 1.0 / LARGEST <= x <= LARGEST, "unusable number")]
Length = Annotated[Number, must(lambda x: 0.0 <= x <= LARGEST, "unusable number")]
Deviation = Positive | tuple[Length, Length]
FacetError = tuple[Label, Length, Length]
Scales = Annotated[Pair, must(lambda pair: min(pair) > 0.0 and max(pair) <= LARGEST, "unusable pair")]
ScaleRange = Annotated[Scales, must(lambda ends: ends[0] < ends[1], "empty range of scales")]


def _for_editors(schema: Any) -> Any:
    """Return a part of a JSON Schema in words that all drafts from 7 on read alike.

    There is no null in TOML, a key is left out; a tuple of equal items is a list of fixed length; a key's title would
    only repeat the key; an empty default says nothing.
    """
    if isinstance(schema, list):
        return [_for_editors(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: _for_editors(item) for key, item in schema.items() if key not in ("examples", "enum", "default")}
    given = {key: schema[key] for key in ("enum", "examples") if key in schema}
    if schema.get("default") not in (None, "", [], {}):
        given["default"] = schema["default"]
    choices = [item for item in kept.pop("anyOf", []) if item != {"type": "null"}]
    kept |= choices[0] if len(choices) == 1 else {"anyOf": choices} if choices else {}
    items = kept.get("prefixItems", [])
    if items and all(item == items[0] for item in items):
        kept["items"] = kept.pop("prefixItems")[0]
    return {**kept, **given}


def one_of(*alternatives: tuple[str, ...]) -> dict[str, Any]:
    """Return, for a JSON Schema, that the keys of exactly one of these ways are given."""
    return {"oneOf": [{"required": list(keys)} for keys in alternatives]}


class _InOrder(GenerateJsonSchema):
    """Keeps the order of keys, which examples are read in."""

    def sort(self, value: JsonSchemaValue, parent_key: str | None = None) -> JsonSchemaValue:
        return value


class Entry(BaseModel):
    """Refuses unknown keys and says, for a missing key or a wrong value, what the field's description says."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @classmethod
    def model_json_schema(cls, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """Return the JSON Schema, from which editors of TOML files complete and check."""
        return super().model_json_schema(*args, **{"schema_generator": _InOrder, **kwargs})

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Return the JSON Schema of this kind of table, see `_for_editors`."""
        reference = handler(core_schema)
        schema = handler.resolve_ref_schema(reference)
        for key, item in schema.get("properties", {}).items():
            made = _for_editors(item)
            made.pop("title", None)
            if isinstance(made.get("default"), dict):
                del made["default"]
            schema["properties"][key] = made
        return reference

    @model_validator(mode="before")
    @classmethod
    def _keys(cls, data: Any) -> Any:
        fields = cls.model_fields
        if not isinstance(data, Mapping):
            raise refusal("expected a table", found=data, allowed=f"a table with {', '.join(fields)}")
        for key in data:
            if key not in fields:
                what = f"unknown key '{key}'{closest(str(key), fields)}"
                raise refusal(what, found=data[key], allowed=", ".join(fields), inside=(str(key),))
        for key, item in fields.items():
            if item.is_required() and key not in data:
                found = f"only {', '.join(data)}" if data else "an empty table"
                raise refusal("missing key", found=found, allowed=str(item.description), inside=(key,))
        return data

    @field_validator("*", mode="wrap")
    @classmethod
    def _value(cls, value: Any, handler: Any, info: ValidationInfo) -> Any:
        try:
            return handler(value)
        except ValidationError as error:
            details = error.errors(include_url=False)
            refused = next((detail for detail in details if detail["type"] == REFUSED), details[0])
            table = isinstance(value, Mapping) and refused["type"] != REFUSED  # its key is wrong, not that it is none
            places = [descend(value, detail["loc"]) for detail in (details if table else [refused])]
            inside, found = max(places, key=lambda own: len(own[0]))
            if refused["type"] == REFUSED:
                context = refused["ctx"]
                if context["allowed"]:
                    raise
                what, found, inside = context["what"], context["found"], (*inside, *context["inside"])
            elif any(detail["type"] == "finite_number" for detail in details):
                what = "a number is not finite"
            elif len(details) > 1:
                what = "wrong type, unit or shape"
            else:
                known = refused["type"] == "literal_error" and isinstance(found, str)
                what = f"unknown {info.field_name}" if known else unfit(refused)
            field = cls.model_fields[str(info.field_name)]
            hint = closest(found, _words(field.annotation)) if isinstance(found, str) else ""
            if isinstance(found, str) and (share := re.fullmatch(r"\s*(\d*\.?\d+)\s*%\s*", found)):
                hint = f", write {float(share[1]) / 100.0:.6g}"
            if isinstance(found, str) and info.field_name == "tolerance" and FIT_LETTERS.fullmatch(found):
                hint = ": letters of a fit are written as limits of a [[size]], tolerance = [LOWER, UPPER]"
            raise refusal(what + hint, found=found, allowed=str(field.description), inside=inside) from error


FILES = {"bodies": "problem file", "part": "file of an assembly", "vary": "study file, which fcdm-opt study takes"}
"""What a file is, by a key that only such a file has."""


def read_entry(model: type[Read], path: str | os.PathLike[str], kind: str, needed: str) -> Read:
    """Return the checked contents of a TOML file; `kind` and `needed` say what it is and must have."""
    file = checked_path(path, kind)
    if file.suffix.lower() in mesh_formats:
        what = f"a mesh file, and no {kind}: fcdm-opt init MOVABLE STATIC writes one about two meshes"
        raise InputError(what, file=file, allowed=f"a {kind} (TOML)")
    try:
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            allowed = f"a {kind} (TOML) of at most {LARGEST_FILE} bytes"
            raise InputError("the file is too large", file=file, allowed=allowed)
        text = content.decode("utf-8-sig")  # some editors begin a file with a mark
        data = parsed(text)
    except UnicodeDecodeError as reason:
        raise InputError("not a text file in UTF-8", file=file, found=reason.object[reason.start]) from reason
    except InputError as reason:
        raise reason.within(file=file) from reason
    except (RecursionError, ValueError) as reason:  # nested too deep, numbers too long, a path with a null
        raise InputError(f"the file cannot be read: {str(reason)[:100]}", file=repr(str(file))) from reason
    except OSError as reason:
        allowed = f"a readable {kind} (TOML){similar_name(Path(file))}"
        raise InputError("the file cannot be read", file=file, found=reason.strerror, allowed=allowed) from reason
    if not data:
        raise InputError("the file is empty", file=file, allowed=needed)
    for key, other in FILES.items():
        if key in data and key not in model.model_fields:
            raise InputError(f"a {other}, and no {kind}", file=file, found=", ".join(data), allowed=needed)
    try:
        return checked(model, data, file)
    except RecursionError as reason:
        raise InputError("tables nested too deep", file=file, allowed=f"the keys of a {kind}") from reason


def _path(place: Sequence[Any], data: Mapping[str, Any]) -> str:
    """Return a place in words: `case[2] 'B'.motion[1].centre`."""
    text = ""
    for item in place:
        text += f"[{item + 1}]" if isinstance(item, int) else f".{item}"
    if len(place) > 1 and place[0] == "case" and isinstance(place[1], int):
        case = data["case"][place[1]]
        name = case.get("name") if isinstance(case, Mapping) else None
        head = f".case[{place[1] + 1}]"
        text = f"{head} {name!r}{text[len(head) :]}" if isinstance(name, str) else text
    return text.removeprefix(".")


def _tables_with(model: type[BaseModel], *place: str) -> str:
    """Return the tables of a file that have a key, the last of a place that has not; "" for none, and for many."""

    def has(kind: Any) -> bool:
        return place[-1] in getattr(kind, "model_fields", ()) or any(map(has, get_args(kind)))

    kinds = {key: item.annotation for key, item in model.model_fields.items() if len(place) < 3}
    tables = [f"[[{key}]]" if get_origin(kind) is list else f"[{key}]" for key, kind in kinds.items() if has(kind)]
    return " and ".join(tables) if len(tables) < 3 else ""


def checked(
    model: type[Read],
    data: Mapping[str, Any],
    file: Path | None = None,
    *,
    placed: Callable[[Sequence[Any], Mapping[str, Any]], str] = _path,
) -> Read:
    """Return plain data as an entry; raises `InputError` that names the place in it, as `placed` writes it."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        detail = next(item for item in error.errors(include_url=False) if item["type"] == REFUSED)
        context = detail["ctx"]
        inside, _ = descend(data, detail["loc"])
        key = placed((*inside, *context["inside"]), data) or None
        allowed, what = context["allowed"], context["what"]
        if what.startswith("unknown key"):
            tables = _tables_with(model, *(own for own in (*inside, *context["inside"]) if not isinstance(own, int)))
            what = f"{what.partition(HINT)[0]}: a key of {tables}" if tables else what
        raise InputError(what, file=file, key=key, found=context["found"], allowed=allowed) from error
