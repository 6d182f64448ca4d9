"""The front door: what people call, and the applications: pipeline, commands, report, studio, live page, study."""
