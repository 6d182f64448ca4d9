"""What several test files share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of real recordings, from the environment variable SCANWRIGHT_DATA."""
    folder = os.environ.get("SCANWRIGHT_DATA")
    if not folder:
        pytest.skip("SCANWRIGHT_DATA is not set: it names the folder of real recordings")
    return Path(folder)
