"""What the documents say: code prints what stands below it; commands, files, links and names exist."""

from __future__ import annotations

import contextlib
import importlib
import io
import math
import re
from pathlib import Path
from typing import Any

import pytest
import typer
from documents import NOT_RUN, ROOT, Command, Document, agree, documents
from PIL import Image
from scipy.special import ndtr
from typer.exceptions import TyperException
from typer.testing import CliRunner

from fcdm_opt.cli import app
from fcdm_opt.show.glossary import WORDS

PAGES = documents("README.md", "docs/**/*.md")
ALL = [*PAGES, *documents("benchmarks/**/*.md", "problems/**/*.md", "CHANGELOG.md")]
WITH_CODE = [page for page in PAGES if any(block.language == "python" and not block.left_out for block in page.blocks)]
MOST_LEFT_OUT = 3  # blocks that are shown and not run, in all pages together
OURS = ("fcdm_opt", "problems", "docs", "benchmarks", "tests", ".ci")  # folders whose files a document may name
PLACEHOLDER = re.compile(r"[A-Z][A-Z0-9_|.]*$")  # FILE, DIR, N; "..." stands for more of them
PROGRAM = typer.main.get_command(app)
each_document = pytest.mark.parametrize("page", ALL, ids=lambda page: page.name)


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.name)
def test_code_prints_what_stands_below_it(page: Document, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blocks of a page follow each other in one namespace, as someone types them at the repository's root."""
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in page.blocks:
        if block.language != "python" or block.left_out:
            continue
        # blank lines before it, so that faults name the document's line
        code = compile("\n" * (block.line - 1) + block.text, page.name, "exec", dont_inherit=True)
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(code, names)
        if block.prints is None:
            continue
        assert agree(printed.getvalue(), block.prints), (
            f"{page.name}:{block.line} prints\n{printed.getvalue()}\nand not\n{block.prints}"
        )


SAMPLE = """# A heading: with `code`, twice

## Twice {#by-hand}
## Twice

<!-- not run -->

```python title="x"
never()
```
```python
print(1)
```

```text
1
```

1. In a list:

    ```console
    $ fcdm-opt solve a.toml \\
        --json  # and a comment
    fcdm-opt answers
    ```

    more of the list, [a link](other.md#there "title"), `fcdm-opt curve
    FILE` and `[no](link)`.

    cd x && .venv/bin/fcdm-opt study FILE [--jobs N [--engine dask]] | cat
"""


def test_the_reader_finds_what_is_there(tmp_path: Path) -> None:
    path = tmp_path / "sample.md"
    path.write_text(SAMPLE.replace("1. In a list", "Above\n\n1. In a list").replace("\n    cd x", "\nx\n\n    cd x"))
    page = Document(path)
    left_out, counted, *_ = page.blocks
    assert (left_out.left_out, left_out.text, left_out.prints) == (True, "never()\n", None)
    assert (counted.left_out, counted.text, counted.prints) == (False, "print(1)\n", "1\n")
    assert page.lines[counted.line - 1] == "print(1)"
    words = [command.words for command in page.commands]
    assert words == [
        ("solve", "a.toml", "--json"),
        ("study", "FILE", "--jobs", "N", "--engine", "dask"),
        ("curve", "FILE"),
    ]
    assert [target for target, _ in page.links] == ["other.md#there"]
    assert {"a-heading-with-code-twice", "twice", "twice-1", "twice_1", "by-hand"} <= page.anchors


@pytest.mark.parametrize(
    ("printed", "shown", "same"),
    [
        ("a\nb\n", "a\nb\n", True),
        ("a 1.0\n", "a 1\n", False),
        ("a\nb\nc\n", "a\n...\nc\n", True),
        ("a\nc\n", "a\n...\nc\n", True),
        ("a\nb\n", "a\n", False),
        ("", "a\n", False),
        ("a\n", "...\nb\n", False),
    ],
)
def test_texts_agree_line_by_line(printed: str, shown: str, same: bool) -> None:
    assert agree(printed, shown) is same


def test_few_blocks_are_left_out() -> None:
    left_out = [f"{page.name}:{block.line}" for page in PAGES for block in page.blocks if block.left_out]
    assert len(left_out) <= MOST_LEFT_OUT, left_out
    shown = [block for page in PAGES for block in page.blocks if block.language == "python" and block.prints]
    assert len(shown) > len(left_out)
    markers = sum(line.strip() == NOT_RUN for page in PAGES for line in page.lines)
    assert markers == len(left_out), "a marker that stands before no block"


@each_document
def test_commands_and_their_options_exist(page: Document) -> None:
    for command in page.commands:
        try:
            parsed(command)
        except (AssertionError, TyperException) as reason:
            pytest.fail(f"{page.name}:{command.line}: {' '.join(command.words)}: {reason}")


@each_document
def test_files_that_commands_and_sentences_name_exist(page: Document) -> None:
    shown = re.findall(r"as `([\w.]+)`:\n\n```toml", page.path.read_text("utf-8"))
    made = [Path(name) for name in shown]  # the page has them whole; and by earlier commands of the page
    for words, line in page.typed:
        for word in words[1:]:
            if word.split("/")[0] in OURS and "/" in word:
                assert any(ROOT.glob(word)) or within(Path(word), made), f"{page.name}:{line}: there is no {word}"
        if words[0] in ("cp", "mkdir", "curl"):
            made.append(Path(words[-1]))
    left_out = {
        line
        for block in page.blocks
        if block.left_out
        for line in range(block.line, block.line + block.text.count("\n"))
    }
    for command in page.commands:
        given = parsed(command)
        out = given.pop("out", None)
        for path in paths_in(given):
            known = (ROOT / path).exists() or within(path, made) or PLACEHOLDER.match(path.name)
            assert known or command.line in left_out, f"{page.name}:{command.line}: there is no {path}"
        made += paths_in(out)
    for code, line in page.spans:
        if re.fullmatch(r"[\w.*-]+(/[\w.*-]+)+/?", code) and code.split("/")[0] in OURS:
            assert any(ROOT.glob(code)), f"{page.name}:{line}: there is no {code}"


@each_document
def test_links_pictures_and_anchors_exist(page: Document) -> None:
    for target, line in page.links:
        if re.match(r"[a-z][a-z+.-]*:", target):  # another place: https, mailto
            continue
        name, _, anchor = target.partition("#")
        path = (page.path.parent / name).resolve() if name else page.path
        where = f"{page.name}:{line}: {target}"
        assert path.is_relative_to(ROOT), f"{where} leaves the repository"
        assert path.exists() or is_generated(path), f"{where} does not exist"
        if not anchor or path.suffix != ".md" or not path.exists():
            continue
        if anchor.startswith("fcdm_opt."):
            assert exists(anchor), f"{where} names nothing of the package"
        else:
            assert anchor in Document(path).anchors, f"{where}: no such heading"


@each_document
def test_pictures_were_white_plates_on_dark_pages(page: Document) -> None:
    """Each has a form for these: of the same size, dark where it is light."""
    text = page.path.read_text(encoding="utf-8")
    for name in set(re.findall(r"([\w./-]*pictures/[\w-]+?)(?:-dark)?\.png", text)):
        assert f'srcset="{name}-dark.png"' in text, f"{page.name}: {name} has no dark form"
        light, dark = (Image.open(page.path.parent / f"{name}{own}.png").convert("L") for own in ("", "-dark"))
        assert light.size == dark.size, f"{page.name}: {name}"
        assert dark.resize((1, 1)).getpixel((0, 0)) < 80 < 175 < light.resize((1, 1)).getpixel((0, 0)), name


@each_document
def test_names_of_the_package_exist(page: Document) -> None:
    for code, line in page.spans:
        found = re.fullmatch(r"((?:fo|fcdm_opt(?:_benchmarks)?)(?:\.[A-Za-z_]\w*)+)(\(.*\))?", code)
        if found:
            assert exists(found[1]), f"{page.name}:{line}: there is no {found[1]}"


def parsed(command: Command) -> dict[str, Any]:
    """Parse as the command line does, without running; returns what was given by the parameters' names.

    A mention within a sentence may leave arguments out: there only the command and its options must exist.
    """
    name, *words = [word for word in command.words if word != "..."] or ["--help"]
    if name.startswith("-") or PLACEHOLDER.match(name):
        name, words, program = "fcdm-opt", [name] * name.startswith("-"), PROGRAM
    else:
        assert name in PROGRAM.commands, f"no such command: {name}"
        program = PROGRAM.commands[name].make_context(name, [], resilient_parsing=True).command
    known = {option for given in program.params for option in (*given.opts, *given.secondary_opts)} | {"--help"}
    for word in words:
        assert not word.startswith("-") or word.partition("=")[0] in known, f"no such option of {name}: {word}"
    if "--help" in words or program is PROGRAM or not (command.typed or any(word[0] != "-" for word in words)):
        return {}
    numbers = ["1" if word == "N" else word for word in words]
    return dict(program.make_context(name, numbers).params)


def paths_in(given: Any) -> list[Path]:
    """Return all paths among the values of parsed parameters."""
    if isinstance(given, dict | list | tuple):
        return [path for item in (given.values() if isinstance(given, dict) else given) for path in paths_in(item)]
    return [given] if isinstance(given, Path) else []


def within(path: Path, made: list[Path]) -> bool:
    return any(path == place or place in path.parents for place in made)


def is_generated(path: Path) -> bool:
    """Tell whether the documentation's build makes this page; built strictly, it refuses to miss one."""
    site = ROOT / "mkdocs.yml"
    return path.parent == ROOT / "docs" and site.exists() and path.name in re.findall(r"[\w-]+\.md", site.read_text())


def exists(name: str) -> bool:
    """Tell whether a dotted name stands for a module, or something in one."""
    parts = name.split(".")
    if parts[0] == "fo":
        parts[0] = "fcdm_opt"
    value: Any = importlib.import_module(parts[0])
    for k, part in enumerate(parts[1:], 2):
        if part in getattr(value, "__dataclass_fields__", {}):
            return k == len(parts)
        if not hasattr(value, part):
            try:
                importlib.import_module(".".join(parts[:k]))
            except ImportError:
                return False
        value = getattr(value, part)
    return True


def test_the_first_result_is_what_the_first_line_prints() -> None:
    page = next(page for page in PAGES if page.path.name == "paper-examples.md")
    shown = next(block.text for block in page.blocks if block.text.startswith("example1.toml: "))
    printed = CliRunner().invoke(app, ["solve", "--certify", str(ROOT / "problems/example1.toml")])
    assert printed.exit_code == 0
    lines = printed.stdout.splitlines()
    kept = [line.rstrip() for line in lines if not line.startswith("time of ")]
    assert "\n".join(kept).strip() == shown.strip()


def test_the_first_screens_are_short() -> None:
    """What it is, whether it is for one and how to start: read in under a minute and a half."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    head = re.sub(r"(?s)```.*?```|<(?:img|source).*?>", "", text[: text.index("## Your own parts")])
    assert len(head.split()) <= 350
    assert len(text.split()) <= 1800


def test_the_glossary_is_what_reports_explain() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (.*?) \| (.*) \|$", text[text.index("## Words") :].split("\n## ")[0], flags=re.MULTILINE)
    assert dict(rows[1:]) == WORDS
    assert len(WORDS) == 12


def test_the_first_verdicts_are_what_the_two_commands_print(tmp_path: Path) -> None:
    meshes = [str(ROOT / "problems/meshes" / name) for name in ("square_peg.stl", "square_plate.stl")]
    own = str(tmp_path / "mine.toml")
    assert CliRunner().invoke(app, ["init", *meshes, "--unit", "mm", "--out", own]).exit_code == 0
    printed = CliRunner().invoke(app, ["solve", "--certify", own]).stdout
    page = next(page for page in PAGES if page.name == "README.md")
    shown = next(block.text for block in page.blocks if block.text.startswith("A: move square_peg"))
    assert shown.strip() in printed


def test_the_fit_of_two_step_files_is_what_stack_prints() -> None:
    """Worst case and share by hand: halves of what the limits differ by, and a normal distribution."""
    page = next(page for page in PAGES if page.path.name == "round-parts.md")
    command = next(own for own in page.commands if own.words[0] == "stack")
    printed = CliRunner().invoke(app, [word.replace("problems/", f"{ROOT}/problems/") for word in command.words])
    assert printed.exit_code == 0
    shown = next(block.text for block in page.blocks if "bush +0.035" in block.text)
    assert agree("\n".join(line.rstrip() for line in printed.stdout.splitlines()), "...\n" + shown + "...\n")
    ends, deviation = (-0.015, -0.002), math.hypot(0.0105, 0.0065) / 6.0
    share = 100.0 * math.fsum(
        sign * ndtr((end + 0.009) / deviation) for sign, end in zip((-1.0, 1.0), ends, strict=True)
    )
    assert f"{share:.4f}% by root sum square" in printed.stdout
