"""What the tests of parts share."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from scanwright.cad.files.part_files import build_parts
from scanwright.design.progress import no_progress

sys.path.insert(0, str(Path(__file__).parent))  # scanners.py


@pytest.fixture(scope="session")
def built_once(once, parts_of):
    """Of a scanner, the folder of its parts and what `build_parts` gave: made once, for reading only."""

    def anywhere(scanner):
        return parts_of(replace(scanner, angles=scanner.angles.model_copy(update={"t_world_rot_mm": (0.0, 0.0, 0.0)})))

    def build(scanner):
        def made(folder):
            return folder, build_parts(scanner, anywhere(scanner), folder, no_progress)

        return once(f"files of parts {scanner}", made)

    return build
