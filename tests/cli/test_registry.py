"""Commands are told of in one place: their row."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from fcdm_opt.cli import MODULES, app
from fcdm_opt.cli.registry import ROWS

LOOP = Path(__file__).parents[2] / "problems" / "assemblies" / "loop_of_four.toml"


def test_every_command_has_a_row_and_every_row_a_command() -> None:
    found = {name.removesuffix("_command") for own in MODULES for name in vars(own) if name.endswith("_command")}
    assert found == {name for name, row in ROWS.items() if not row.lent}


@pytest.mark.parametrize("name", ["curve", "faces"])
def test_a_refusal_left_out_pose_and_stack_where_it_said_what_takes_assemblies(name: str) -> None:
    told = CliRunner().invoke(app, [name, str(LOOP)])
    assert told.exit_code == 2
    takers = [name for name, row in ROWS.items() if row.assemblies]
    assert {"pose", "stack", "map"} <= {*takers}
    assert f"{', '.join(takers)} take assemblies" in told.stderr
