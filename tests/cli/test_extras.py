"""What is installed only with an extra: asked for before anything is worked out, and named."""

from __future__ import annotations

import importlib.metadata
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from typer.testing import CliRunner

from fcdm_opt.cli import app
from fcdm_opt.errors import InputError
from fcdm_opt.lazy_import import extra

EXAMPLE = str(Path(__file__).parents[2] / "problems" / "example1.toml")


@pytest.mark.parametrize(
    ("command", "name", "missing"), [("solve", "out", "matplotlib"), ("report", "out.html", "plotly.offline")]
)
def test_pictures_were_refused_once_a_case_after_all_was_solved(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, command: str, name: str, missing: str
) -> None:
    from fcdm_opt.show import rendering

    rendering.plotly.cache_clear()
    monkeypatch.setitem(sys.modules, missing, None)  # as if it were not installed
    found = CliRunner().invoke(app, [command, EXAMPLE, "--out", str(tmp_path / name)])
    assert found.exit_code == 2
    assert found.stderr.count("pip install -c constraints.txt -e '.[pictures]'") == 1
    assert not found.stdout
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", ["allocation", "coacd", "dask", "pictures", "step", "tables"])
def test_an_extra_that_is_named_installs_something(name: str) -> None:
    asked = [Requirement(line) for line in importlib.metadata.requires("fcdm_opt") or []]
    assert any(own.marker and own.marker.evaluate({"extra": name}) for own in asked)
    with pytest.raises(InputError, match=rf"nothing_of cannot be loaded .*'\.\[{name}\]'"):
        extra("nothing_of.that", name)
