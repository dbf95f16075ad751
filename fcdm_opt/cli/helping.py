"""How help looks, how the command line answers what it does not understand, and its sign of life.

Plain text in at most 80 columns: the overview lists commands by the question that they answer, each command its
options in groups and examples that run as they stand.

For what takes longer stderr shows what it is at, and how far. Where stderr is a terminal a line at once and then a bar;
elsewhere lines after `ELSEWHERE`, at ever longer intervals.
"""

from __future__ import annotations

import re
import shutil
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import entry_points
from itertools import chain
from time import perf_counter
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from fcdm_opt import pacing
from fcdm_opt.cli.guarding import EXIT_CODES, Manner, guarded, manner, stopped
from fcdm_opt.cli.registry import ROWS
from fcdm_opt.errors import InputError, closest, unfit

OPTIONS = "Options"  # heading of options without a group
LENT = "fcdm_opt.commands"
"""Entry points of commands that another distribution brings: name of a command -> the function that is the command."""
INSTALL = "needs the package fcdm_opt_benchmarks: pip install ./benchmarks, in a copy of the repository"


class Command(TyperCommand):
    """A command whose help ends with its exit codes, and examples, one a line of its epilog."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words of the usage line: FILE... without braces."""
        return [piece.translate({ord(brace): None for brace in "{}"}) for piece in super().collect_usage_pieces(ctx)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then options by group."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is None:
                continue
            name, text = record
            group = getattr(parameter, "rich_help_panel", None) or OPTIONS
            if parameter.param_type_name == "argument":
                group, name = "Arguments", name.split(" ")[0]
                text = text.replace("  [required]", "")
            groups.setdefault(group, []).append((name, text))
        for group in sorted(groups, key=lambda group: (group != "Arguments", group == "Output")):
            with formatter.section(group):
                formatter.write_dl(groups[group])

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the exit codes, and the examples as they are, never folded."""
        formatter.write_paragraph()
        ends = ROWS[self.name or ""].ends
        formatter.write_text(f"Exit codes: {'; '.join(f'{code} {meaning}' for code, meaning in ends.items())}.")
        if self.epilog:
            formatter.write_paragraph()
            formatter.write("Examples:\n" + "".join(f"  {line}\n" for line in self.epilog.splitlines()))


class LentCommand(Command):
    """A command of another distribution: only its name, a sentence and examples are known until it is used."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of the command itself.

        Raises `InputError` where it is not installed; its help says so. While a shell completes words, nothing is
        completed instead.
        """
        points = entry_points(group=LENT, name=self.name or "")
        if not points:
            if extra.get("resilient_parsing") or {"--help", "-h"} & {*args}:
                self.help = f"{self.help}\n\nIt {INSTALL}."
                return super().make_context(info_name, args, parent, **extra)
            raise InputError(INSTALL, key=self.name)
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command(self.name, cls=Command, epilog=self.epilog)(next(iter(points)).load())
        return typer.main.get_command(app).make_context(info_name, args, parent, **extra)


class Overview(TyperGroup):
    """All commands; the only place where a run begins and ends."""

    @property
    def questions(self) -> dict[str, list[str]]:
        """The names of the commands that answer a question, by question."""
        found: dict[str, list[str]] = {}
        for name, command in self.commands.items():
            found.setdefault(command.rich_help_panel, []).append(name)  # type: ignore[attr-defined]
        return found

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands by question, each with the first sentence of its help."""
        for question, names in self.questions.items():
            formatter.write_paragraph()
            formatter.write(f"{question}\n")
            with formatter.indentation():
                helps = [" ".join((self.commands[name].help or "").split("\n\n")[0].split()) for name in names]
                sentences = [re.split(r"[.;:](?: |$)", text)[0] for text in helps]
                formatter.write_dl(list(zip(names, sentences, strict=True)))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the commands before the options, which are few and rarely needed."""
        self.format_commands(ctx, formatter)
        with formatter.section(OPTIONS):
            formatter.write_dl([record for each in self.get_params(ctx) if (record := each.get_help_record(ctx))])

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write how to go on, and the exit codes."""
        formatter.write_paragraph()
        formatter.write_text(f"Help and examples of a command: {ctx.command_path} COMMAND --help")
        formatter.write_paragraph()
        formatter.write_text("Exit codes: " + "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES) + ".")

    def invoke(self, ctx: Any) -> Any:
        """Run a command such that nothing escapes it but an exit code."""
        with pacing.within(None), shown(), guarded():
            return super().invoke(ctx)

    def main(self, args: Sequence[str] | None = None, *, standalone_mode: bool = True, **extra: Any) -> Any:  # type: ignore[override]
        """Run the command line; `--debug` may stand anywhere in it."""
        if not standalone_mode:
            return super().main(args, standalone_mode=False, **extra)
        words = list(sys.argv[1:] if args is None else args)
        ours = words[: words.index("--")] if "--" in words else words
        command = next((word for word in ours if word in self.commands), "")
        before = manner.set(Manner(debug="--debug" in ours, as_json="--json" in ours, command=command))
        words = [word for word in ours if word != "--debug"] + words[len(ours) :]
        try:
            code = super().main(words, standalone_mode=False, **extra)
        except typer.Abort:
            code = stopped(typer.Abort(), "aborted").exit_code
        except Exception as reason:
            if not hasattr(reason, "format_message"):
                raise
            code = stopped(reason, _misunderstood(reason)).exit_code
        finally:
            manner.reset(before)
        sys.exit(code if isinstance(code, int) else 0)


def _misunderstood(reason: Any) -> str:
    """Return in words of ours what is wrong with a command line."""
    ctx, kind = getattr(reason, "ctx", None), type(reason).__name__
    command = ctx.command if ctx is not None else None
    where = f"; see {ctx.command_path} --help" if ctx is not None else ""
    if kind == "NoSuchOption":
        given = command.get_params(ctx) if command is not None else []
        known = [name for each in given for name in each.opts if name.startswith("-")]
        return f"{reason.option_name}: no such option{closest(reason.option_name, known)}{where}"
    unknown = re.match(r"""No such command (['"])(.*?)\1\.""", str(reason.message), re.DOTALL)
    if unknown and command is not None:
        name, known = unknown.group(2), list(command.commands)
        of = [own for own, each in command.commands.items() if f"--{name}" in chain(*(p.opts for p in each.params))]
        hint = f"; an option: fcdm-opt {of[0]} --{name}" if of else closest(name, known)
        return f"{name or repr(name)}: no such command{hint or '; allowed: ' + ', '.join(known)}"
    parameter = getattr(reason, "param", None)
    if kind == "BadOptionUsage":
        return f"{reason.option_name}: its value is missing{where}"
    if parameter is not None:
        name = parameter.opts[0] if parameter.param_type_name == "option" else parameter.metavar or parameter.name
        if kind == "MissingParameter":
            return f"{name}: missing; allowed: {(parameter.help or '').rstrip('.')}{where}"
        for detail in getattr(reason.__cause__, "errors", list)():
            allowed = ", ".join(f"{'>=' if key == 'ge' else key} {x}" for key, x in detail.get("ctx", {}).items())
            return f"{InputError(unfit(detail), key=name, found=detail['input'], allowed=allowed)}{where}"
        return f"{name}: {_lower(reason.message)}{where}"
    row = ROWS.get(command.name) if kind == "UsageError" and command is not None else None
    if row is not None and row.surplus:
        where = f"; {row.surplus}{where}"
    return f"{_lower(reason.message)}{where}"


def _lower(text: str) -> str:
    return (text[:1].lower() + text[1:]).rstrip(".")


PATIENCE, ELSEWHERE = 2.0, 5.0  # seconds after which a command shows a bar, or says elsewhere that it is at work
CLEARED = "\r\x1b[2K"  # what takes such a line away
REFRESH = 0.1  # seconds between two pictures of the bar
QUIET = 0.3  # seconds without output after which the bar is drawn again below it
LATER = 2.0  # how many times as late each further line comes


@contextmanager
def shown() -> Iterator[None]:
    """Show meanwhile what is being done, as `pacing.at` tells it."""
    if sys.stderr is None:
        yield
        return
    sign = _Sign()
    kept, ended = (sys.stdout, sys.stderr), threading.Event()

    def watch() -> None:
        while not ended.wait(REFRESH):
            with suppress(OSError, ValueError):  # nobody can read it any more
                sign.tick()

    watcher = threading.Thread(target=watch, daemon=True)
    if sign.terminal:
        sys.stdout, sys.stderr = (_Above(stream, sign) if stream is not None else stream for stream in kept)
    with pacing.listening(sign.update):
        if sign.terminal:
            sign.tick()
        watcher.start()
        try:
            yield
        finally:
            ended.set()
            watcher.join()
            sign.hide()
            sys.stdout, sys.stderr = kept


class _Sign:
    """What is shown, or was said last."""

    def __init__(self) -> None:
        self.stream: Any = sys.stderr
        self.terminal = bool(self.stream.isatty())
        self._start = self._begun = perf_counter()
        self._written = self._start - QUIET  # nothing is yet
        self._next = 0.0 if self.terminal else ELSEWHERE
        self._doing: tuple[str, int, int] = ("loading libraries", 0, 0)
        self._first = 0  # how many pieces were done when this began
        self._bar: Any = None
        self._line, self._width = False, shutil.get_terminal_size().columns - 1 + len(CLEARED)
        self._lock = threading.RLock()

    def update(self, text: str, done: int, total: int) -> None:
        """Take note of what is being done."""
        if text != self._doing[0]:
            self._begun, self._first = perf_counter(), done
        self._doing = text, done, total

    def tick(self) -> None:
        """Show how far it is, if it is time to."""
        now = perf_counter()
        if now - self._start < self._next or not self._doing[0]:
            return
        if self.terminal:
            if now - self._written >= QUIET:
                self._draw(now - self._start >= PATIENCE)
            return
        text, done, total = self._doing
        counted = f" ({done} of {total})" if total else ""
        self._next *= LATER
        self.stream.write(f"still {text}{counted}, after {now - self._start:.0f} s\n")
        self.stream.flush()

    def _draw(self, bar: bool) -> None:
        if not bar:  # whose libraries are not loaded yet
            with self._lock:
                self.stream.write(f"{CLEARED}{self._doing[0]}"[: self._width])
                self.stream.flush()
                self._line = True
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

        with self._lock:
            text, done, total = self._doing
            if self._bar is None:
                columns = SpinnerColumn(), BarColumn(20), TextColumn("{task.description}", markup=False)
                self._bar = Progress(
                    *columns, console=Console(file=self.stream), transient=True, auto_refresh=False,
                    redirect_stdout=False, redirect_stderr=False,
                )  # fmt: skip
                self._bar.add_task(text, total=None)
                self._bar.start()
            self._clear()
            words = f"{text}, {perf_counter() - self._start:.0f} s"
            spent = perf_counter() - self._begun
            if total and done - self._first > 0:
                words += f", about {spent * (total - done) / (done - self._first):.0f} s more"
            self._bar.update(0, description=words, total=total or None, completed=done)
            self._bar.refresh()

    def _clear(self) -> None:
        if self._line:
            self.stream.write(CLEARED)
            self._line = False

    def hide(self) -> None:
        """Take the bar away, for what is printed or because all is done."""
        with self._lock:
            self._written = perf_counter()
            self._clear()
            if self._bar is not None:
                self._bar.stop()
                self._bar = None


class _Above:
    """A stream whose output stands above the bar: it is taken away first, and comes back later."""

    def __init__(self, stream: Any, sign: _Sign) -> None:
        self._stream, self._sign = stream, sign

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write it where no bar is."""
        self._sign.hide()
        return self._stream.write(text)
