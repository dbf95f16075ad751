"""One base class for everything the toolkit raises.

Bad input raises; a numerical failure is a status of the result (see `fcdm_opt.problem.solution.Status`).
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar, cast, get_args

Called = TypeVar("Called", bound=Callable[..., Any])
HINT, MANY = ", did you mean '", re.compile(r"[\w. \"-]+(, [\w. \"-]+){8,}")  # after a hint so many names are not told
LONGEST = 800  # letters of what is wrong, or of what is allowed: lists of names may have thousands
_OTHER_WORDS = {
    **dict.fromkeys(("inch", "inches"), "in"),
    **dict.fromkeys(("millimetre", "millimeter", "millimetres", "millimeters"), "mm"),
    **dict.fromkeys(("centimetre", "centimeter", "centimetres", "centimeters"), "cm"),
    **dict.fromkeys(("micrometre", "micrometer", "micron", "microns", "\N{MICRO SIGN}m".casefold()), "um"),
    **dict.fromkeys(("metre", "meter", "metres", "meters"), "m"),
    **dict.fromkeys(("foot", "feet"), "ft"),
    **{"part": "body", "bodies": "parts", "sizes": "made", "axis": "along", "face": "faces"},
    **{"tol": "tolerance", "linspace": "grid", "fixed": "motion", "lhs": "latin hypercube"},
    **dict.fromkeys(("sigma", "std"), "deviation"),
    **dict.fromkeys(("draws", "samples"), "count"),
}
"""Names of units that are spelled otherwise in files, and words that stand for a key elsewhere."""


_UNFIT = {
    **dict.fromkeys(("float_type", "float_parsing"), "not a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "not a whole number"),
    **{"string_type": "not text in quotes", "bool_type": "not true or false", "dict_type": "not a table"},
    **dict.fromkeys(("list_type", "tuple_type"), "not a list"),
    **dict.fromkeys(("too_short", "missing"), "too few items"),
    **{"too_long": "too many items", "greater_than_equal": "too small a number"},
    **dict.fromkeys(("bool_parsing", "literal_error"), "an unusable value"),
}
"""Types of errors of pydantic, which reads files and options, in words."""


class FcdmError(Exception):
    """Base of every error that `fcdm_opt` raises on purpose."""


class InputError(FcdmError, ValueError):
    """Input that cannot be used: says where, what was found and what is allowed.

    Parameters
    ----------
    what : str
        What is wrong, in one sentence.
    file : path, optional
        The file it stands in.
    key : str, optional
        The key, argument or body that is wrong, as the user wrote it (`case[1] 'A'.tolerance`, `body 'lid'`).
    found : object, optional
        What was found there.
    allowed : str, optional
        What would be accepted.
    line : int, optional
        The line of the file, from 1; of a TOML file without it that of the key.
    """

    def __init__(
        self,
        what: str,
        *,
        file: str | Path | None = None,
        key: str | None = None,
        found: Any = None,
        allowed: str = "",
        line: int | None = None,
    ) -> None:
        self.what, self.file, self.key, self.found, self.allowed, self.line = what, file, key, found, allowed, line
        line = line or _line(file, key)
        named = f"{file}:{line}" if line and file else file
        place = ": ".join(str(part) for part in (named, key) if part is not None)
        text = _shortened(f"{place}: {what}" if place else what)
        if found is not None:
            shown = _shown(found)
            text += f"; found {shown if len(shown) <= 200 else shown[:197] + '...'}"
        if allowed and not (HINT in what and MANY.fullmatch(allowed)):
            text += f"; allowed: {_shortened(allowed)}"
        super().__init__(text)

    def within(self, *, file: str | Path | None = None, key: str | None = None) -> InputError:
        """Return the same error, placed in a file or below a key of an enclosing structure."""
        option = (self.key or "").startswith("--")  # of the command line: no key of the file
        joined = (": " if option else ".").join(part for part in (key, self.key) if part) or None
        place: dict[str, Any] = {"file": self.file or file, "key": joined, "line": self.line}
        return InputError(self.what, found=self.found, allowed=self.allowed, **place)


def internal(reason: Exception) -> InputError:
    """Return a defect of ours in one line, to be placed and said as bad input is, which is returned as it is.

    Raises again what is neither: a file or a stream that cannot be written, or what ends a command.
    """
    if isinstance(reason, InputError):
        return reason
    if isinstance(reason, OSError) or hasattr(reason, "exit_code"):
        raise reason
    what = f"internal: {type(reason).__name__}: {' '.join(str(reason).split()) or 'no reason given'}"
    found = InputError(f"{what[:200]}; please report it with what the command prints with --debug")
    return found.with_traceback(reason.__traceback__)


@contextmanager
def placed(*, file: str | Path | None = None, key: str | None = None) -> Iterator[None]:
    """Place bad input that is refused meanwhile in a file or below a key, see `InputError.within`."""
    try:
        yield
    except InputError as reason:
        raise reason.within(file=file, key=key) from reason


def expected(value: Any, kind: type | tuple[type, ...], key: str) -> None:
    """Refuse an argument that is not of a kind, or of one of some."""
    if not isinstance(value, kind):
        kinds = " or ".join(own.__name__ for own in (kind if isinstance(kind, tuple) else (kind,)))
        raise InputError(f"expected a {kinds}", key=key, found=type(value).__name__)


def checked_path(value: Any, key: str) -> Path:
    """Return a path to a file or folder; raises `InputError` where the value is none."""
    if not isinstance(value, str | PathLike):
        raise InputError("not a path", key=key, found=value, allowed="text, or a path")
    return Path(value)


def name_list(names: Iterable[str]) -> str:
    """Return names with commas between, those that have a comma themselves in quotes."""
    return ", ".join(f'"{name}"' if "," in name else name for name in names)


def counted(count: int, noun: str) -> str:
    """Return a number of things: "1 part", "2 parts"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def unfit(detail: Mapping[str, Any]) -> str:
    """Return what is wrong with a value in words, from one of the errors of pydantic about it."""
    return _UNFIT.get(detail["type"], str(detail["msg"]).lower())


def closest(key: str, allowed: Iterable[str]) -> str:
    """Return a hint at the allowed key that is spelled most alike, "" where none is near; dashes before it are none."""
    import difflib

    words = {word.casefold().removeprefix("--"): word for word in allowed}
    asked = key.casefold().removeprefix("--")
    near = difflib.get_close_matches(asked, list(words), 1)
    meant = _OTHER_WORDS.get(asked, "")
    found = meant if meant in words else words[near[0]] if near else ""
    return f"{HINT}{found}'?" if found else ""


def known_word(word: Any, known: Iterable[str], what: str, *, key: str | None, more: str = "") -> Any:
    """Return one of the words that are known; refuses another, `what` it is, with a hint at the one spelled most alike.

    `more` is allowed besides.
    """
    words = [*known]
    if isinstance(word, str) and word in words:
        return word
    hint, allowed = closest(word, words) if isinstance(word, str) else "", f"{name_list(words)}{more}"
    raise InputError(f"{what}{hint}", key=key, found=word, allowed=allowed or "none is given")


def similar_name(path: Path) -> str:
    """Return a hint at what is named most alike in the folder of a path, "" where nothing is."""
    import difflib

    with suppress(OSError, ValueError):
        every = [*path.parent.iterdir()]
        near = difflib.get_close_matches(path.stem, [own.stem for own in every])  # all suffixes are alike
        return "" if path.exists() else closest(path.name, (own.name for own in every if own.stem in near))
    return ""


def known_arguments(function: Called) -> Called:
    """Have a function, or class, refuse arguments by name that it does not have, or lacks, as `InputError`."""
    if isinstance(function, type):
        function.__init__ = known_arguments(function.__init__)  # type: ignore[misc]
        return function
    code = function.__code__
    known = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    names = [name for name in known if name not in ("self", "cls")]
    made = function.__annotations__.get("return", "")  # a class, by its name
    needed = [name for name in known[code.co_argcount :] if name not in (function.__kwdefaults__ or {})]

    @functools.wraps(function)
    def checked(*arguments: Any, **named: Any) -> Any:
        for key, value in named.items():
            if key not in known:
                changed = hasattr(function.__globals__.get(made), f"with_{key}")  # what it returns has it so
                hint = f": .with_{key}(...) of the {made} gives it" if changed else closest(key, names)
                what = f"unknown argument '{key}'{hint}"
                raise InputError(what, key=key, found=value, allowed=", ".join(names) or "none")
        for key in needed:
            if key not in named:
                words = get_args(function.__globals__.get(function.__annotations__.get(key, "")))  # of a Literal
                allowed = " or ".join(f'{key}="{word}"' for word in words)
                raise InputError("this argument is missing", key=key, allowed=allowed)
        return function(*arguments, **named)

    return cast("Called", checked)


def _shortened(text: str) -> str:
    """Return a text, of thousands of names the first and how many more there are."""
    if len(text) <= LONGEST:
        return text
    kept, _, rest = text[:LONGEST].rpartition(", ")
    more = text[len(kept) :].count(", ")
    return f"{kept}, ... and {more:,} more" if rest and more > 1 else f"{text[:LONGEST]}..."


def _line(file: str | Path | None, key: str | None) -> int | None:
    """Return the line of a TOML file at which a key stands, or the table that it would stand in; None where unknown."""
    if file is None or not key or Path(file).suffix != ".toml" or ": --" in key:
        return None
    try:
        lines = Path(file).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError):
        return None
    found, names = dict[tuple[str, ...], int](), dict[tuple[str, ...], tuple[str, ...]]()
    table = place = tuple[str, ...]()
    for number, line in enumerate(lines, 1):
        if head := re.match(r"\s*\[(\[?)\s*([^\]]+?)\s*\]", line):
            table = tuple(part.strip(" \"'") for part in head[2].split("."))
            if head[1]:
                count = 1 + sum(own[:-1] == table and own[-1].isdecimal() for own in found)
                table = (*table, str(count))
            found.setdefault(table, number)
        elif own := re.match(r"""\s*([A-Za-z0-9_."'-]+)\s*=\s*(?:["'](.*?)["'])?""", line):
            place = (*table, *(part.strip(" \"'") for part in own[1].split(".")))
            found.setdefault(place, number)
            if place[-1] == "name" and own[2]:  # cases and sizes go by their names, too
                names.setdefault((*table[-2:-1], f"'{own[2]}'"), table)
    place = ()
    for part in re.findall(r"[A-Za-z_][\w-]*|(?<=\[)\d+|'[^']*'", key):  # case[2] 'B' is known by its number
        place = names.get((*place[-1:], part), place) if part[0] == "'" else (*place, part)
    shared = place[2:] if place[:1] == ("case",) else ()  # what a case does not give itself is that of all
    places = [place[:k] for k in range(len(place), 2 * bool(shared), -1)]
    places += [(*head, *shared[:k]) for k in range(len(shared), 0, -1) for head in (("defaults",), ())]
    return next((found[own] for own in (*places, place[:2], place[:1]) if own in found), None)


def _shown(found: Any) -> str:
    try:
        return repr(found) if isinstance(found, str) else re.sub(r"\bnp\.\w+\(([^()]*)\)", r"\1", repr(found))
    except ValueError:  # whole numbers of so many digits that Python does not write them
        return f"{type(found).__name__} with too many digits"


class UnsolvedError(FcdmError):
    """Raised by `solve(..., throw=True)` where the result cannot be used; carries the `Solution`."""

    def __init__(self, solution: Any) -> None:
        self.solution = solution
        super().__init__(solution.explained)
