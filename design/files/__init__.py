"""Files of people and programs: read with checks, written in one step."""
