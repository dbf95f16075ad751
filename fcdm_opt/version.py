"""The version of the package that is installed; a part of the keys of all rows of studies."""

from __future__ import annotations

from importlib.metadata import version

__version__: str = version("fcdm_opt")
