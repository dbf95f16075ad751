"""The reference of the command line, from the commands themselves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

PROGRAM = "fcdm-opt"
OPTIONS = "Options"  # group of the options that have none


def exit_codes() -> str:
    """Return the table of exit codes."""
    from fcdm_opt.cli.guarding import EXIT_CODES

    return "\n".join(_table("exit code", [(str(code), meaning) for code, meaning in EXIT_CODES]))


def commands() -> str:
    """Return the commands by the question that they answer, the program's options, and a section for each command."""
    import typer

    from fcdm_opt.cli import app

    program: Any = typer.main.get_command(app)
    context = typer.Context(program, info_name=PROGRAM)
    lines = []
    for question, names in program.questions.items():
        listed = ", ".join(f"[`{name}`](#{PROGRAM}-{name})" for name in names)
        lines += [f"- {question} {listed}"]
    lines += ["", "These options stand before any command:", "", *_table("option", _records(program.params, context))]
    for name, command in program.commands.items():
        own = command.make_context(name, [], resilient_parsing=True)
        lines += ["", f"## {PROGRAM} {name}", "", *_section(own.command, own)]
    return "\n".join(lines)


def _section(command: Any, context: Any) -> Iterator[str]:
    """Yield usage, meaning, arguments, options by group, and examples of a command."""
    from fcdm_opt.cli.registry import ROWS

    usage = " ".join([PROGRAM, context.info_name, *command.collect_usage_pieces(context)])
    yield from ("```text", usage, "```", "")
    yield from (_plain(line.strip()) for line in (command.help or "").strip().splitlines())
    groups: dict[str, list[Any]] = {}
    for own in command.params:
        kind = "argument" if own.param_type_name == "argument" else getattr(own, "rich_help_panel", None) or OPTIONS
        groups.setdefault(kind, []).append(own)
    for kind in sorted(groups, key=lambda kind: (kind != "argument", kind == "Output")):
        head = "option" if kind == OPTIONS else kind[0].lower() + kind[1:]
        yield from ("", *_table(head, _records(groups[kind], context)))
    ends = "; ".join(f"{code} {meaning}" for code, meaning in ROWS[command.name or ""].ends.items())
    yield from ("", f"Exit codes: {_plain(ends)}.")
    if command.epilog:
        yield from ("", "```text", *command.epilog.strip().splitlines(), "```")


def _records(parameters: Iterable[Any], context: Any) -> Iterator[tuple[str, str]]:
    """Yield spelling and meaning of those that help shows."""
    for own in parameters:
        record = own.get_help_record(context)
        if record:
            yield record[0].split(" <")[0], record[1]  # how the source calls its type is nobody's business


def _table(head: str, rows: Iterable[tuple[str, str]]) -> Iterator[str]:
    yield from (f"| {head} | meaning |", "|---|---|")
    for names, meaning in rows:
        name, text = (cell.replace("|", "\\|") for cell in (names, _plain(meaning)))
        yield f"| `{name}` | {text} |"


def _plain(text: str) -> str:
    """Return text with the signs escaped that Markdown would take for its own."""
    for sign in "*_[]<":
        text = text.replace(sign, "&lt;" if sign == "<" else f"\\{sign}")
    return text
