"""One scan: its plan, the devices at work, the recorder, the doctor."""
