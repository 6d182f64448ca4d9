"""`python -m scanwright` is the command `scanwright`."""

from scanwright.cli.app import run

if __name__ == "__main__":
    run()
