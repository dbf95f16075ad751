"""Markdown files as tests need them: code blocks with what they print, commands, links, headings, names in code."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).parents[2]
NOT_RUN = "<!-- not run -->"  # directly before a block
SHELLS = ("sh", "bash", "shell", "console")

_FENCE = re.compile(r"^(?P<indent>\s*)(?P<marks>`{3,}|~{3,})\s*(?P<language>[\w-]*)")
_NOTE_OR_LIST = re.compile(r"\s*([-*+]\s|\d+[.)]\s|!!!|\?\?\?|===)")
_HEADING = re.compile(r"^#{1,6}\s+(?P<text>.*?)\s*#*$")
_SPAN = re.compile(r"(?<!`)(`+)(?!`)(?P<code>.+?)(?<!`)\1(?!`)", re.DOTALL)
_LINK = re.compile(
    r"\]\(\s*<?([^\s)>]+)>?[^)]*\)"  # [text](target "title") and pictures
    r"|^ {0,3}\[[^\]]+\]:\s+<?([^\s>]+)"  # [text]: target
    r"|<(?:a|img|source)\b[^>]*?\b(?:href|src|srcset)=[\"']([^\"']+)",
    re.MULTILINE,
)
_OWN_ANCHOR = re.compile(r"\bid=[\"']([^\"']+)[\"']|\{:?\s*#([\w.-]+)")


@dataclass(frozen=True)
class Block:
    """A code block; indented code has no language.

    Attributes
    ----------
    language : str
        First word after the fence, in lower case.
    text : str
        Without fences and indentation, with a line break at the end.
    line : int
        Number of its first line in the document, from 1.
    left_out : bool
        Whether the line before it, blank ones apart, is the marker `NOT_RUN`.
    prints : str or None
        The block of language "text" that directly follows, only blank lines between.
    """

    language: str
    text: str
    line: int
    left_out: bool = False
    prints: str | None = None


@dataclass(frozen=True)
class Command:
    """One `fcdm-opt` command as written.

    Attributes
    ----------
    words : tuple of str
        What follows the program's name.
    line : int
        In the document, from 1.
    typed : bool
        Whether it is a line to type, not a mention within a sentence.
    """

    words: tuple[str, ...]
    line: int
    typed: bool


@dataclass(frozen=True)
class Document:
    """A markdown file of the repository."""

    path: Path

    @property
    def name(self) -> str:
        """Path from the repository's root."""
        return self.path.relative_to(ROOT).as_posix()

    @cached_property
    def lines(self) -> list[str]:
        """Its lines."""
        return self.path.read_text(encoding="utf-8").splitlines()

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """Fenced and indented code, in order."""
        blocks = []
        for k, (language, start, end, indent) in enumerate(self._code):
            prints = None
            if k + 1 < len(self._code):
                following, first, last, margin = self._code[k + 1]
                if following == "text" and not any(map(str.strip, self.lines[end + 1 : first - 1])):
                    prints = self._dedented(first, last, margin)
            above = next((line for line in reversed(self.lines[: start - (language is not None)]) if line.strip()), "")
            text = self._dedented(start, end, indent)
            blocks.append(Block(language or "", text, start + 1, above.strip() == NOT_RUN, prints))
        return tuple(blocks)

    @cached_property
    def prose(self) -> str:
        """The text without code blocks and comments, line for line."""
        lines = list(self.lines)
        for language, start, end, _ in self._code:
            fences = int(language is not None)
            lines[start - fences : end + fences] = [""] * (end - start + 2 * fences)
        return re.sub(r"<!--.*?-->", _blank, "\n".join(lines), flags=re.DOTALL)

    @cached_property
    def spans(self) -> tuple[tuple[str, int], ...]:
        """Code within sentences, with its line."""
        return tuple((" ".join(at["code"].split()), _line(at)) for at in _SPAN.finditer(self.prose))

    @cached_property
    def links(self) -> tuple[tuple[str, int], ...]:
        """Targets of links and pictures as written, with their line."""
        return tuple(
            (next(filter(None, at.groups())), _line(at)) for at in _LINK.finditer(_SPAN.sub(_blank, self.prose))
        )

    @cached_property
    def anchors(self) -> frozenset[str]:
        """What `#...` may name here: headings as GitHub and as mkdocs call them, and identifiers given by hand."""
        seen: Counter[tuple[str, str]] = Counter()
        anchors = {one or other for one, other in _OWN_ANCHOR.findall(self.prose)}
        for heading in filter(None, map(_HEADING.match, self.prose.splitlines())):
            plain = re.sub(r"[^\w\s-]", "", re.sub(r"\{[^}]*\}$", "", heading["text"])).strip().lower()
            for slug, separator in ((re.sub(r"\s", "-", plain), "-"), (re.sub(r"[\s-]+", "-", plain), "_")):
                repeats = seen[slug, separator]
                anchors.add(f"{slug}{separator}{repeats}" if repeats else slug)
                seen[slug, separator] += 1
        return frozenset(anchors)

    @cached_property
    def typed(self) -> tuple[tuple[tuple[str, ...], int], ...]:
        """Commands of any program that are to be typed, as words; comments and a console's answers are left out."""
        commands = []
        for block in self.blocks:
            if block.language not in (*SHELLS, ""):
                continue
            whole = ""
            for number, line in enumerate(block.text.splitlines(), block.line):
                if block.language == "console" and not whole and not line.startswith("$ "):
                    continue
                whole += line.removeprefix("$ ")
                if whole.endswith("\\"):
                    whole = whole[:-1]
                else:
                    commands += [(words, number) for words in _parts(whole)]
                    whole = ""
        return tuple(commands)

    @cached_property
    def commands(self) -> tuple[Command, ...]:
        """Every `fcdm-opt` command: typed, or as code within a sentence."""
        found = [Command(words[1:], line, True) for words, line in self.typed if _is_ours(words)]
        for code, line in self.spans:
            found += [Command(words[1:], line, False) for words in _parts(code) if _is_ours(words) and words[1:]]
        return tuple(found)

    @cached_property
    def _code(self) -> list[tuple[str | None, int, int, int]]:
        """Language (None: indented code), first line, line after the last, indentation; lines counted from 0."""
        found: list[tuple[str | None, int, int, int]] = []
        k, above = 0, ""  # `above`: the last line at the margin, which says whether indentation means code
        while k < len(self.lines):
            line = self.lines[k]
            if fence := _FENCE.match(line):
                close = re.compile(rf"\s*{re.escape(fence['marks'])}{fence['marks'][0]}*\s*$")
                end = next((j for j in range(k + 1, len(self.lines)) if close.match(self.lines[j])), None)
                if end is None:
                    raise ValueError(f"{self.name}:{k + 1}: this block has no end")
                found.append((fence["language"].lower(), k + 1, end, len(fence["indent"])))
                k = end + 1
                continue
            start = k
            if line.startswith("    ") and not (k and self.lines[k - 1].strip()) and not _NOTE_OR_LIST.match(above):
                while k < len(self.lines) and self.lines[k].startswith("    "):
                    k += 1
                found.append((None, start, k, 4))
            else:
                above = line if line.strip() and not line.startswith(" ") else above
                k += 1
        return found

    def _dedented(self, start: int, end: int, indent: int) -> str:
        return "".join(line[indent:] + "\n" for line in self.lines[start:end])


def documents(*patterns: str) -> list[Document]:
    """Return the documents that match these patterns, which start at the repository's root."""
    return [Document(path) for pattern in patterns for path in sorted(ROOT.glob(pattern))]


def agree(printed: str, shown: str) -> bool:
    """Tell whether the text printed is the one shown, where a line `...` stands for any lines, or none."""
    wild = "(?:.*\n)*"
    pattern = "".join(wild if line.strip() == "..." else re.escape(line.rstrip()) + "\n" for line in shown.splitlines())
    return re.fullmatch(pattern, "".join(line.rstrip() + "\n" for line in printed.splitlines())) is not None


def _line(at: re.Match[str]) -> int:
    return at.string.count("\n", 0, at.start()) + 1


def _blank(found: re.Match[str]) -> str:
    return re.sub(r"[^\n]", " ", found[0])


def _is_ours(words: Sequence[str]) -> bool:
    return words[0].removeprefix(".venv/bin/") == "fcdm-opt"


def _parts(line: str) -> Iterator[tuple[str, ...]]:
    """Split a shell line into commands of words; brackets around what may be left out are dropped."""
    try:
        words = shlex.split(line, comments=True)
    except ValueError:  # no shell line
        return
    part: list[str] = []
    for word in [*words, ";"]:
        if word in ("&&", "||", ";", "|"):
            if part:
                yield tuple(part)
            part = []
            continue
        if word.startswith("[-"):
            word = word[1:]
        part.append(word.rstrip("]") if word.count("]") > word.count("[") else word)
