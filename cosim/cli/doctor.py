"""`hybrid-fmu doctor`: what this machine has of what the project can use, and whether a model runs."""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import hybrid_model as hm
from cosim.cli.exits import Exit
from cosim.cli.progress import Work
from fmu.build.platforms import PLATFORMS
from fmu.errors import BuildError
from fmu.standard.platforms import this_machine
from hybrid_model.native.build.cache_folder import cache_root, trusted_folder
from hybrid_model.native.build.compiler import find_compiler, zig_compiler

NAME = "hybrid-fmu"
_EXTRA = re.compile(r"extra == ['\"]([\w-]+)['\"]")
_PACKAGE = re.compile(r"[\w.-]+")


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    with Work() as work:
        work.begin("looking at this machine")
        found = examination()
    print(json.dumps(found, indent=2) if options.json else as_text(found))
    return Exit.DONE if found["compiler"]["found"] and found["run"]["native"] else Exit.FAILED


def examination() -> dict[str, Any]:
    """Return what there is, by topic."""
    here = "-".join(this_machine())
    compiler, cross = _compiler(find_compiler), _compiler(zig_compiler)
    return {
        "hybrid-fmu": {"version": hm.__version__, "folder": str(Path(hm.__file__).parents[1])},
        "python": {"version": platform.python_version(), "program": sys.executable, "system": platform.platform()},
        "packages": _versions(set()),
        "compiler": compiler,
        "cache": _cache(),
        "platforms": {
            name: "this machine" if name == here and compiler["found"] else "by ziglang" if cross["found"] else None
            for name in PLATFORMS
        },
        "extras": {extra: _versions({extra}) for extra in sorted(_extras())},
        "run": _run(),
    }


def _compiler(find: Any) -> dict[str, Any]:
    try:
        command = find()
        told = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=60, check=False).stdout
        return {"found": True, "command": " ".join(command), "version": next(iter(told.splitlines()), "")}
    except (BuildError, hm.HybridModelError) as error:
        return {"found": False, "remedy": str(error)}


def _cache() -> dict[str, Any]:
    folder, trusted = cache_root(), trusted_folder()
    files = [path for path in folder.rglob("*") if path.is_file()] if folder.is_dir() else []
    size = sum(path.stat().st_size for path in files)
    return {"folder": str(folder), "used": trusted is not None, "files": len(files), "megabytes": round(size / 1e6, 1)}


def _requirements() -> list[str]:
    try:
        return metadata.requires(NAME) or []
    except metadata.PackageNotFoundError:
        return []


def _extras() -> set[str]:
    return {found[1] for line in _requirements() if (found := _EXTRA.search(line))} - {"dev"}


def _versions(extras: set[str]) -> dict[str, str | None]:
    """Return the installed versions of the packages of an extra, of the core's without one."""
    versions: dict[str, str | None] = {}
    for line in _requirements():
        extra, package = _EXTRA.search(line), _PACKAGE.match(line)
        if package is not None and ({extra[1]} if extra else set()) == extras and package[0] != NAME:
            try:
                versions[package[0]] = metadata.version(package[0])
            except metadata.PackageNotFoundError:
                versions[package[0]] = None
    return versions


def _run() -> dict[str, Any]:
    from hybrid_model.models import BouncingBall

    arc = hm.simulate(BouncingBall(), 1.0)
    return {"native": arc.engine.startswith("native"), "engine": arc.engine, "events": len(arc.jumps)}


def as_text(found: dict[str, Any]) -> str:
    """Return the same for people."""
    compiler, cache, ran = found["compiler"], found["cache"], found["run"]
    told = f"{compiler['command']}: {compiler['version']}" if compiler["found"] else f"none: {compiler['remedy']}"
    built = [f"{name} ({how})" for name, how in found["platforms"].items() if how]
    missing = [name for name, how in found["platforms"].items() if not how]
    lines = [
        f"hybrid-fmu {found['hybrid-fmu']['version']} in {found['hybrid-fmu']['folder']}",
        f"python     {found['python']['version']} at {found['python']['program']}, {found['python']['system']}",
        f"packages   {_listed(found['packages'])}",
        f"compiler   {told}",
        f"cache      {cache['folder']}, {cache['files']} files, {cache['megabytes']} MB"
        + ("" if cache["used"] else "; not used, as it cannot be written or others can write to it"),
        f"FMUs for   {', '.join(built) or 'no platform'}",
    ]
    if missing:
        lines.append(f'           not for {", ".join(missing)}: pip install "hybrid-fmu[zig]"')
    for extra, versions in found["extras"].items():
        absent = [name for name, version in versions.items() if version is None]
        remedy = f'; missing: {", ".join(absent)} (pip install "hybrid-fmu[{extra}]")' if absent else ""
        there = _listed({name: version for name, version in versions.items() if version})
        lines.append(f"extra      {extra}: {there or 'nothing installed'}{remedy}")
    lines.append(f"a run      {ran['events']} impact{'s' * (ran['events'] != 1)} of the bouncing ball; {ran['engine']}")
    if os.environ.get("CC"):
        lines.append(f"CC         {os.environ['CC']}")
    return "\n".join(lines)


def _listed(versions: dict[str, str | None]) -> str:
    return ", ".join(f"{name} {version or 'MISSING'}" for name, version in versions.items())
