"""The catalogue against facts about the real devices."""
