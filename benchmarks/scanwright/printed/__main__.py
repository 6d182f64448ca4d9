"""Compare the printed output in README and docs with runs, or renew it.

    uv run python -m benchmarks.scanwright.printed [--write] [PAGE...]

Runs the marked blocks (`benchmarks.scanwright.printed.blocks`) of each page one after another in one folder, so that a
block uses the files of those above it. `emulate` runs until the page is done. Prints a line for each block and exits
with 1 if one differs; `--write` replaces the output in the page instead.
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from difflib import unified_diff
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.scanwright.printed.blocks import blocks_of, with_output
from benchmarks.scanwright.printed.shell import Shell

ROOT = Path(__file__).parents[3]


def main() -> None:
    """Run, then compare or write."""
    write = "--write" in sys.argv
    names = [name for name in sys.argv[1:] if name != "--write"]
    pages = [Path(name) for name in names] or [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    different = 0
    for path in (page for page in pages if "_build" not in page.parts):
        different += _compared(path, write)
    sys.exit(1 if different and not write else 0)


def _compared(path: Path, write: bool) -> int:
    """Compare the blocks of a page with runs; return how many differ."""
    text, different, longer = path.read_text(encoding="utf-8"), 0, 0
    with TemporaryDirectory() as folder, ExitStack() as running:
        shell = Shell(Path(folder), running)
        for block in blocks_of(text):
            printed = shell.run(block.command)
            same = block.agrees(printed)
            print(f"{path.name}:{block.line}: {'same' if same else 'differs'}: {block.command}", flush=True)
            if not same and write:
                renewed = block.renewed(printed)
                text = with_output(text, block, renewed, longer)
                longer += len(renewed) - len(block.output)
            elif not same:
                print("\n".join(unified_diff(block.output, printed, "page", "run", lineterm="")))
            different += not same
    if write:
        path.write_text(text, encoding="utf-8")
    return different


if __name__ == "__main__":
    main()
