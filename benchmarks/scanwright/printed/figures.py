"""Write the figures of `benchmarks/figures.toml` into README and docs, or list the pages that differ.

uv run python -m benchmarks.scanwright.printed.figures [--check]
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[3]
FIGURES: dict[str, str] = tomllib.loads((ROOT / "benchmarks/figures.toml").read_text(encoding="utf-8"))
_MARKED = re.compile(r"(<!-- figure: (\w+) -->)[^<]*(<!-- end -->)")


def main() -> None:
    """Write, or list; exit with 1 if `--check` lists a page."""
    different = []
    for path in pages():
        text = path.read_text(encoding="utf-8")
        if (new := with_figures(text)) != text:
            different.append(path)
            if "--check" not in sys.argv:
                path.write_text(new, encoding="utf-8")
    print("\n".join(map(str, different)) or "all figures are current")
    sys.exit(1 if different and "--check" in sys.argv else 0)


def pages() -> list[Path]:
    """Return README and the pages."""
    docs = (page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts)
    return [ROOT / "README.md", *sorted(docs)]


def with_figures(text: str) -> str:
    """Return a page with the figures between its marks.

    Raises:
        KeyError: there is no such figure.
    """
    return _MARKED.sub(lambda mark: f"{mark[1]}{FIGURES[mark[2]]}{mark[3]}", text)


if __name__ == "__main__":
    main()
