"""Marked blocks of a page: a command with its output, which a run can be compared with.

A block is marked by the line before it, `<!-- printed -->`, `<!-- printed: mask REGEX -->` or
`<!-- printed: numbers -->`:

    <!-- printed: mask in [0-9.]+ s$ -->
    ```console
    $ scanwright optimise ground_ahead
    search, without parts in the way:
    [...]
    ```

A line `[...]` in it is any number of lines. Text that the mask matches can differ; with `numbers`, all
numbers and the spaces before them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

GAP = "[...]"
_MARKED = re.compile(
    r"(?P<mark><!-- printed(?P<option>[^\n]*?) -->\n)```(?P<kind>\w*)\n(?P<text>.*?)^```", re.DOTALL | re.MULTILINE
)
_OPTION = re.compile(r"|: numbers|: mask (?P<mask>.+)")
NUMBER = r" *[-+]?\d[\d.,e-]*"


@dataclass(frozen=True, slots=True)
class Block:
    """A command and its output.

    Attributes:
        line: number of its mark in the page, from 1.
        command: text after `$ `; a line of it can end with a backslash.
        output: the lines below it.
        mask: pattern of the text that can differ; empty if none can.
    """

    line: int
    command: str
    output: tuple[str, ...]
    mask: str

    def masked(self, line: str) -> str:
        """Return a line of output without the text that can differ."""
        return re.sub(self.mask, "#", line) if self.mask else line

    def renewed(self, printed: list[str]) -> list[str]:
        """Return the output as a run printed it, with the gaps of the page if its lines still exist."""
        if GAP not in self.output:
            kept = dict(zip(map(self.masked, self.output), self.output, strict=True))
            return [kept.get(self.masked(line), line) for line in printed]
        renewed, rest = [], printed
        for line in self.output:
            if line == GAP:
                renewed.append(GAP)
                continue
            places = [k for k, new in enumerate(rest) if _key(new) == _key(line)]
            if not places:
                return printed
            new, rest = rest[places[0]], rest[places[0] + 1 :]
            renewed.append(line if self.masked(new) == self.masked(line) else new)
        return renewed

    def agrees(self, printed: list[str]) -> bool:
        """Return whether a run printed this."""
        pattern = "".join(r"(?:.*\n)*?" if one == GAP else re.escape(self.masked(one)) + "\n" for one in self.output)
        return re.fullmatch(pattern, "".join(f"{self.masked(line)}\n" for line in printed)) is not None


def _key(line: str) -> str:
    """Return a line without its numbers and spaces."""
    return re.sub(r"[-+\d.,\s]", "", line)


def blocks_of(page: str) -> list[Block]:
    """Return the marked blocks of a page.

    Raises:
        ValueError: a mark without a console block, a command or output, or with an option that is unknown.
    """
    marks = [number for number, line in enumerate(page.splitlines(), 1) if line.startswith("<!-- printed")]
    found = {page.count("\n", 0, match.start()) + 1: match for match in _MARKED.finditer(page)}
    return [_block(number, found.get(number)) for number in marks]


def _block(line: int, match: re.Match[str] | None) -> Block:
    if match is None or match["kind"] != "console":
        raise ValueError(f"line {line}: no console block after the mark")
    option = _OPTION.fullmatch(match["option"])
    if option is None:
        raise ValueError(f"line {line}: unknown option {match['option']!r} (allowed: mask REGEX, numbers)")
    first, *output = match["text"].replace("\\\n", "\\\0").splitlines()
    command = first.replace("\\\0", "\\\n")
    if not first.startswith("$ scanwright ") or not output or any(one.startswith("$ ") for one in output):
        raise ValueError(f"line {line}: a block is one command `$ scanwright ...` and its output")
    mask = option["mask"] or (NUMBER if match["option"] else "")
    try:
        re.compile(mask)
    except re.error as error:
        raise ValueError(f"line {line}: mask {mask!r}: {error}") from None
    return Block(line, command.removeprefix("$ "), tuple(output), mask)


def with_output(page: str, block: Block, output: list[str], lower: int = 0) -> str:
    """Return the page with other output of a block, which is `lower` lines below its place."""
    lines = page.splitlines()
    start = block.line + lower + 2 + block.command.count("\n")  # after the mark, the fence and the command
    lines[start : start + len(block.output)] = output
    return "\n".join(lines) + "\n"
