"""What the tests of design share."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # scans.py, random_fields.py
