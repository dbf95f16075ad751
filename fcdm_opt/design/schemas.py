"""The JSON Schema of problem and study files, from the very models that read them."""

from __future__ import annotations

from typing import Any

from fcdm_opt.errors import InputError

DIALECT = "https://json-schema.org/draft/2020-12/schema"  # the name of the dialect: nothing is asked there
KINDS = ("problem", "study")


def json_schema(kind: str = "problem") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a kind of file; editors complete and check files by it.

    Parameters
    ----------
    kind : "problem" or "study"

    Raises
    ------
    InputError
        For another kind.
    """
    from fcdm_opt.design.study.schema import StudyFile
    from fcdm_opt.problem.keys import ProblemFile

    if kind not in KINDS:
        raise InputError("no such kind of file", key="--what", found=kind, allowed=", ".join(KINDS))
    model = ProblemFile if kind == "problem" else StudyFile
    document = model.model_json_schema()
    document.pop("title", None)
    head = {"$schema": DIALECT, "$id": f"urn:fcdm-opt:{kind}", "title": f"{kind.capitalize()} file of fcdm-opt (TOML)"}
    return {**head, **document}
