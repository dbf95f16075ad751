"""Results as plain data: lists, dicts, texts and numbers, as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, MISSING, fields
from enum import Enum
from functools import cached_property
from types import UnionType
from typing import Any, ClassVar, Literal, Self, get_args, get_origin, get_type_hints

import numpy as np

from fcdm_opt.errors import InputError

DIGITS = 9  # significant digits of what is only drawn: far finer than any screen, and half the length of a float


class ShortRepr:
    """Base of the dataclasses, made with repr=False, of which a session shows the first line that `print` shows."""

    __slots__ = ()

    def __repr__(self) -> str:
        """Return the name of the class and the first line of its text."""
        return f"{type(self).__name__}({str(self).partition(chr(10))[0]})"


class Plain:
    """Base of the dataclasses that can be told as plain data.

    `plain_names` lists the attributes that are told, in order; a class without it tells all its fields. `plain_kinds`
    says of which type those are told that are another as attributes.
    """

    __slots__ = ()
    plain_names: ClassVar[tuple[str, ...]] = ()
    plain_kinds: ClassVar[Mapping[str, Any]] = {}

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan becomes None and infinity "inf"."""
        names = self.plain_names or tuple(item.name for item in fields(self))  # type: ignore[arg-type]
        return {name: plain(getattr(self, name)) for name in names}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild what told all its fields; raises `InputError` for anything else."""
        kinds, every = get_type_hints(cls), fields(cls)  # type: ignore[arg-type]
        listed = {*(cls.plain_names or kinds), *data}
        names = [item.name for item in every if item.name in listed or item.default is MISSING]
        try:
            return cls(**{name: _read(kinds[name], data[name]) for name in names})
        except InputError:
            raise
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as reason:
            if isinstance(reason, KeyError) and cls.plain_names and reason.args[0] not in cls.plain_names:
                what = f"the plain data of a {cls.__name__} are without its {reason.args[0]}, and cannot be read back"
                raise InputError(what, allowed="what it is of, asked again") from reason
            raise InputError(f"not the plain data of a {cls.__name__}", found=str(reason)) from reason


def plain(value: Any, infinite: Callable[[float], Any] = str) -> Any:
    """Return a value as JSON has it: None for nan, "inf" or "-inf" in words, a member of an enum by its name."""
    if isinstance(value, float):
        return None if math.isnan(value) else float(value) if math.isfinite(value) else infinite(float(value))
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "from_label"):
        return value.label
    if isinstance(value, np.ndarray | np.generic):
        known = value.dtype.kind != "f" or np.isfinite(value).all()
        return value.tolist() if known else plain(value.tolist(), infinite)
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(name): plain(inner, infinite) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner, infinite) for inner in value]
    return value.name if isinstance(value, Enum) else value


def agree(given: Any, own: Any, slack: float, share: float = 1e-9) -> bool:
    """Tell whether plain data say the same, but for a share of numbers, and what is within `slack`."""
    if isinstance(given, Mapping) and isinstance(own, Mapping):
        return given.keys() == own.keys() and all(agree(given[key], own[key], slack, share) for key in own)
    if isinstance(given, list | tuple) and isinstance(own, list | tuple):
        return len(given) == len(own) and all(agree(*pair, slack, share) for pair in zip(given, own, strict=True))
    if {type(given), type(own)} <= {int, float}:
        return math.isclose(given, own, rel_tol=share, abs_tol=slack)
    return type(given) is type(own) and bool(given == own)


def finite(value: Any) -> Any:
    """Return a value as `plain` does, and None for every number that JSON does not have."""
    return plain(value, lambda number: None)


def drawn(value: Any) -> Any:
    """Return arrays and lists of numbers as JSON has them, floats to `DIGITS` digits."""
    value = finite(value)
    if isinstance(value, list):
        return [drawn(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def schema_of(kind: Any, known: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of the plain data of a kind of value; classes on the way join `known`, by their names."""
    inner, plain_class = get_args(kind), isinstance(kind, type) and issubclass(kind, Plain)
    if get_origin(kind) is UnionType:
        return {"anyOf": [schema_of(own, known) for own in inner]}
    if get_origin(kind) in (Mapping, dict):
        return {"type": "object", "additionalProperties": schema_of(inner[1], known)}
    if get_origin(kind) is tuple and inner[-1] is not Ellipsis:
        parts = [schema_of(own, known) for own in inner]
        return {"type": "array", "prefixItems": parts, "minItems": len(parts), "maxItems": len(parts)}
    if get_origin(kind) in (tuple, np.ndarray):
        return {"type": "array", **({"items": schema_of(inner[0], known)} if get_origin(kind) is tuple else {})}
    if get_origin(kind) is Literal:
        return {"enum": [*inner]}
    if isinstance(kind, type) and issubclass(kind, Enum):
        return {"enum": [own.name for own in kind]}
    if plain_class and "to_dict" in vars(kind) and not kind.plain_names:  # in a way of its own
        return {"type": "object"}
    if plain_class or (isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")):
        if kind.__name__ not in known:
            known[kind.__name__] = {}  # one that has itself in it
            known[kind.__name__] = _object_schema(kind, known)
        return {"$ref": f"#/$defs/{kind.__name__}"}
    if hasattr(kind, "from_dict"):
        return {"type": "object"}
    if kind is float:
        return {"anyOf": [{"type": ["number", "null"]}, {"enum": ["inf", "-inf"]}]}
    words = {int: "integer", bool: "boolean", str: "string", type(None): "null"}
    return {"type": "string"} if hasattr(kind, "from_label") else {"type": words[kind]} if kind in words else {}


def _object_schema(kind: type, known: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of what a class tells: of each attribute by its annotation, or by what its property returns."""
    kinds = {**get_type_hints(kind), **getattr(kind, "plain_kinds", {})}
    own_names = [name for name, own in kinds.items() if get_origin(own) is not ClassVar and own is not KW_ONLY]
    members = {}
    for name in getattr(kind, "plain_names", ()) or own_names:
        own = getattr(kind, name, None)
        getter = getattr(own, "fget", None) or getattr(own, "func", None)
        returned = get_type_hints(getter).get("return", Any) if getter else Any
        found = schema_of(kinds.get(name, returned), known)
        late = isinstance(own, cached_property) and "$ref" in found  # told where it was worked out already
        members[name] = {"anyOf": [found, {"type": "null"}]} if late else found
    text = (kind.__doc__ or "").partition("\n")[0]
    needed = [name for name in members if name != "problem"]  # which contacts of an assembly have from that
    return {"type": "object", "description": text, "properties": members, "required": needed}


def _read(kind: Any, given: Any) -> Any:
    inner = get_args(kind)
    if hasattr(kind, "from_dict") and isinstance(given, kind):
        return given  # read already
    if get_origin(kind) is UnionType and inner[1:] == (type(None),):
        return None if given is None else _read(inner[0], given)
    if get_origin(kind) is Mapping:
        return {str(name): _read(inner[1], value) for name, value in given.items()}
    if isinstance(given, str) and get_origin(kind) in (tuple, np.ndarray):
        raise TypeError(f"{given!r} is no list")
    if get_origin(kind) is tuple:
        kinds = [inner[0]] * len(given) if inner[-1] is Ellipsis else inner
        return tuple(_read(one, value) for one, value in zip(kinds, given, strict=True))
    if get_origin(kind) is np.ndarray:
        array = np.array(given, dtype=get_args(inner[1])[0])  # None becomes nan
        array.flags.writeable = False
        return array
    if isinstance(kind, type) and issubclass(kind, tuple):  # a named one
        return kind(**{name: _read(one, given[name]) for name, one in get_type_hints(kind).items()})
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind[given]
    for method in ("from_dict", "from_label"):
        if hasattr(kind, method):
            return getattr(kind, method)(given)
    if kind is float:
        return math.nan if given is None else given if type(given) is int else float(given)
    if kind in (int, str, bool) and not isinstance(given, kind):
        raise TypeError(f"{given!r} is no {kind.__name__}")
    if get_origin(kind) is Literal and given not in inner:
        raise TypeError(f"{given!r} is none of {inner}")
    return given
