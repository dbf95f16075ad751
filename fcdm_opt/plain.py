"""Results as plain data: lists, dicts, texts and numbers, as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from typing import Any, ClassVar

import numpy as np


class Plain:
    """Base of the dataclasses that can be told as plain data.

    `plain_names` lists the attributes that are told, in order; a class without it tells all its fields.
    """

    __slots__ = ()
    plain_names: ClassVar[tuple[str, ...]] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan becomes None and infinity "inf"."""
        names = self.plain_names or tuple(item.name for item in fields(self))  # type: ignore[arg-type]
        return {name: plain(getattr(self, name)) for name in names}


def plain(value: Any) -> Any:
    """Return a value as JSON has it: None for nan, "inf" or "-inf" in words, a member of an enum by its name."""
    if isinstance(value, float):
        return None if math.isnan(value) else float(value) if math.isfinite(value) else str(float(value))
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, np.ndarray | np.generic):
        finite = value.dtype.kind != "f" or np.isfinite(value).all()
        return value.tolist() if finite else plain(value.tolist())
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(name): plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    return value.name if isinstance(value, Enum) else value
