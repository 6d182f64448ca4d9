#!/usr/bin/env python3
"""Build the wheel and the sdist into `dist/` without network, and check both: `.ci/package.py [vVERSION]`.

Run it with the Python of the development environment, which holds the pinned hatchling. The checks: the wheel holds
the files of the packages and nothing else; the sdist makes the same wheel; an offline install starts quickly. With
a tag, its version must be the built one. `.ci/base.py` shows that an installed wheel works.
"""

import argparse
import hashlib
import os
import resource
import statistics
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from collections import Counter
from pathlib import Path

from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).parents[1]
# processor time of a start, at most, in times of a peer: on a slow computer both take longer
STARTS = (
    (("python", "-c", "import scanwright"), 3.0, ("python", "-c", "import inspect")),
    (("scanwright", "--help"), 3.0, ("python", "-c", "import typer.main")),
)


def build_wheel(source: Path, folder: Path) -> Path:
    """Build the wheel of a source tree into a folder."""
    return Path(next(WheelBuilder(str(source)).build(directory=str(folder), versions=["standard"])))


def build_sdist(source: Path, folder: Path) -> Path:
    """Build the sdist of a source tree into a folder."""
    return Path(next(SdistBuilder(str(source)).build(directory=str(folder), versions=["standard"])))


def contents(wheel: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of a wheel, by its name."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: hashlib.sha256(archive.read(name)).hexdigest() for name in archive.namelist()}


def unpacked(sdist: Path, folder: Path) -> Path:
    """Unpack an sdist and return its one folder."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    return folder / sdist.name.removesuffix(".tar.gz")


def source_files(source: Path) -> list[Path]:
    """Return the files of a checkout, sorted, without those that git ignores."""
    command = ["git", "-C", str(source), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return sorted(path for name in set(listed.split("\0")) if name and (path := source / name).is_file())


def package_files(source: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of the packages that pyproject.toml names, by its path in the checkout."""
    wheel = tomllib.loads((source / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    folders = [(source / package).resolve() for package in wheel["packages"]]
    files = [path for path in source_files(source) if any(folder in path.resolve().parents for folder in folders)]
    return {path.relative_to(source).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def faults_of_wheel(held: dict[str, str], packages: dict[str, str]) -> list[str]:
    """Compare the files of a wheel with those of the packages, by content: a build may give folders other names."""
    packed = {name: digest for name, digest in held.items() if ".dist-info/" not in name}
    foreign = Counter(packed.values()) - Counter(packages.values())
    absent = Counter(packages.values()) - Counter(packed.values())
    faults = [f"{name}: in the wheel, but in no package" for name, digest in packed.items() if digest in foreign]
    faults += [f"{name}: not in the wheel" for name, digest in packages.items() if digest in absent]
    return faults if any(name.endswith("licenses/LICENSE") for name in held) else [*faults, "LICENSE: not in the wheel"]


def faults_of_sdist(source: Path, tree: Path) -> list[str]:
    """Compare an unpacked sdist with the checkout that it was made of; only PKG-INFO is new."""
    ours = {path.relative_to(source).as_posix(): path.read_bytes() for path in source_files(source)}
    theirs = {path.relative_to(tree).as_posix(): path.read_bytes() for path in tree.rglob("*") if path.is_file()}
    theirs.pop("PKG-INFO", None)
    names = sorted(name for name in ours.keys() | theirs.keys() if ours.get(name) != theirs.get(name))
    return [f"{name}: differs between the checkout and the sdist" for name in names]


def differences(one: dict[str, str], other: dict[str, str]) -> list[str]:
    """Name each file that two wheels do not share byte for byte."""
    names = sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))
    return [f"{name}: the sdist makes another one than the checkout" for name in names]


def slow_starts(wheel: Path, environment: Path) -> list[str]:
    """Install a wheel from the cache alone, with what `uv sync` resolved, and time its start."""
    sync = ["uv", "sync", "--quiet", "--offline", "--frozen", "--no-default-groups", "--no-install-project"]
    at = {"UV_PROJECT_ENVIRONMENT": str(environment)}
    subprocess.run([*sync, "--python", sys.executable], check=True, cwd=ROOT, env=os.environ | at)
    install = ["uv", "pip", "install", "--quiet", "--offline", "--no-deps", "--python", str(environment), str(wheel)]
    subprocess.run(install, check=True)
    subprocess.run(["uv", "pip", "check", "--quiet", "--python", environment], check=True)
    faults = []
    for start, most, peer in STARTS:
        ours_s, theirs_s = (median_s(environment / "bin", command) for command in (start, peer))
        found = f"{' '.join(start)}: {ours_s:.2f} s of processor time, {ours_s / theirs_s:.1f} times {' '.join(peer)}"
        print(found)
        if ours_s >= most * theirs_s:
            faults.append(f"{found}: too slow (allowed {most:g} times)")
    return faults


def median_s(programs: Path, command: tuple[str, ...]) -> float:
    """Return the median processor time of five runs of a command, in seconds."""
    return statistics.median(processor_s([programs / command[0], *command[1:]]) for _ in range(5))


def processor_s(command: list[str | Path]) -> float:
    """Return the processor time of a command, in seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Build, check, print each fault on standard error; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("tag", nargs="?", help="tag of the release, such as v0.2.0")
    tag = parser.parse_args().tag
    for old in (ROOT / "dist").glob("scanwright-*"):
        old.unlink()
    wheel, sdist = build_wheel(ROOT, ROOT / "dist"), build_sdist(ROOT, ROOT / "dist")
    version = wheel.name.split("-")[1]
    faults = [] if tag in (None, f"v{version}") else [f"tag {tag}: the version is {version}"]
    with tempfile.TemporaryDirectory() as temporary:
        tree, held = unpacked(sdist, Path(temporary)), contents(wheel)
        faults += faults_of_wheel(held, package_files(ROOT)) + faults_of_sdist(ROOT, tree)
        faults += differences(held, contents(build_wheel(tree, Path(temporary))))
        faults += slow_starts(wheel, Path(temporary) / "venv")
    print(*(f"error: {fault}" for fault in faults), sep="\n", end="\n" if faults else "", file=sys.stderr)
    print(f"{wheel.name}, {sdist.name}: {'faults above' if faults else 'complete, equal, quick to start'}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
