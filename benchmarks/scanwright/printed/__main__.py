"""Compare the printed output in README and docs with runs, or renew it.

    uv run python -m benchmarks.scanwright.printed [--write] [PAGE...]

Runs the command of every marked block (`benchmarks.scanwright.printed.blocks`) in an empty folder. Prints a line for
each block and exits with 1 if one differs; `--write` replaces the output in the page instead.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from difflib import unified_diff
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.scanwright.printed.blocks import Block, blocks_of, with_output

ROOT = Path(__file__).parents[3]


def main() -> None:
    """Run, then compare or write."""
    write = "--write" in sys.argv
    names = [name for name in sys.argv[1:] if name != "--write"]
    pages = [Path(name) for name in names] or [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    different = 0
    for path in (page for page in pages if "_build" not in page.parts):
        text = path.read_text(encoding="utf-8")
        for block in reversed(blocks_of(text)):  # from below, so that the lines above keep their numbers
            printed = run(block)
            same = block.agrees(printed)
            print(f"{path.name}:{block.line}: {'same' if same else 'differs'}: {block.command}", flush=True)
            if not same and write:
                text = with_output(text, block, block.renewed(printed))
            elif not same:
                print("\n".join(unified_diff(block.output, printed, "page", "run", lineterm="")))
            different += not same
        if write:
            path.write_text(text, encoding="utf-8")
    sys.exit(1 if different and not write else 0)


def run(block: Block) -> list[str]:
    """Return the lines that the command of a block prints on standard output."""
    words = shlex.split(block.command)[1:]
    with TemporaryDirectory() as folder:
        result = subprocess.run(
            [sys.executable, "-m", "scanwright", *words], cwd=folder, capture_output=True, text=True, check=False
        )
    if result.returncode not in (0, 1):
        raise SystemExit(f"{block.command}: exit code {result.returncode}\n{result.stderr}")
    return result.stdout.splitlines()


if __name__ == "__main__":
    main()
