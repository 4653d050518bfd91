"""The libraries of the engine and of models: what they export, and when they are compiled."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import read_scenario
from hybrid_model.errors import BuildError
from hybrid_model.models.bouncing_ball import BouncingBall
from hybrid_model.native.build import libraries
from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.libraries import MODEL_SYMBOL, engine_library, model_library
from hybrid_model.native.model_code import model_code
from hybrid_model.native.networks.network import NetworkTrace, trace_any

posix = pytest.mark.skipif(sys.platform == "win32", reason="a wrapper around the compiler is a shell script")
NOW = getattr(os, "RTLD_NOW", 0)
TINY = '#include "model.h"\nconst Model model = {.name = "Tiny"};\n'


@pytest.fixture
def calls(tmp_path, monkeypatch):
    """A compiler that writes down how it is called, and an empty cache; gives the calls that compile or link."""
    script, log = tmp_path / "logged-cc", tmp_path / "calls.txt"
    script.write_text(f'#!/bin/sh\necho "$@" >> "{log}"\nexec {find_compiler()[0]} "$@"\n')
    script.chmod(0o755)
    log.write_text("")
    monkeypatch.setenv("CC", str(script))
    monkeypatch.setenv("HYBRID_FMU_CACHE", str(tmp_path / "cache"))
    return lambda: [line for line in log.read_text().splitlines() if line != "--version"]


def model_name(path):
    """The first member of the model."""
    function = getattr(ctypes.CDLL(str(path)), MODEL_SYMBOL)
    function.restype = ctypes.POINTER(ctypes.c_char_p)
    return function()[0].decode()


def exported(path):
    done = subprocess.run(["nm", "-D", "--defined-only", str(path)], capture_output=True, text=True, check=True)
    return {line.split()[-1] for line in done.stdout.splitlines()}


def test_a_model_is_found_in_its_library():
    source = model_code(trace_any(BouncingBall()))
    assert model_name(model_library(source)) == "BouncingBall"


def test_a_network_brings_the_loops_over_its_tables():
    """All symbols are there: the loader of this process binds them at once."""
    edges = [[k, k % 14 + 1] for k in range(1, 15)]
    network = {"agents": 14, "edges": edges, "initial": [0.0] * 14}
    entries = {"name": "ring", "stop_time": 1.0, "network": network, "weights": {"kind": "constant", "value": 1.0}}
    entries["trigger"] = {"kind": "dynamic", "threshold": 0.1, "decay": 0.1}
    traced = trace_any(closed_loop(read_scenario(entries)))
    assert isinstance(traced, NetworkTrace)
    path = model_library(model_code(traced))
    ctypes.CDLL(str(path), NOW)
    assert model_name(path) == "ring"


@pytest.mark.skipif(shutil.which("nm") is None, reason="needs nm")
def test_a_model_exports_one_function():
    assert exported(model_library(model_code(trace_any(BouncingBall())))) == {MODEL_SYMBOL}


@pytest.mark.skipif(shutil.which("nm") is None, reason="needs nm")
def test_the_engine_leaves_nothing_open():
    path = engine_library()
    ctypes.CDLL(str(path), NOW)
    done = subprocess.run(["nm", "-D", "--undefined-only", str(path)], capture_output=True, text=True, check=True)
    assert not [line for line in done.stdout.splitlines() if line.split()[-1].startswith(("engine_", "network_"))]


@posix
def test_a_model_is_one_call_of_the_compiler_and_no_second_one(calls):
    assert {model_name(model_library(TINY)) for _ in range(3)} == {"Tiny"}
    assert len(calls()) == 1


@posix
def test_the_engine_is_compiled_once(calls, tmp_path, monkeypatch):
    for name, sources in (("ENGINE_FOLDERS", "ab"), ("RUNS_FOLDERS", "c")):
        folder = tmp_path / name
        folder.mkdir()
        for source in sources:
            (folder / f"{source}.c").write_text(f"int {source} = 1;\n")
        monkeypatch.setattr(libraries, name, (folder,))
    assert len({engine_library() for _ in range(3)}) == 1
    assert len(calls()) == len("abc") + 1


@posix
@pytest.mark.parametrize("change", ["source", "header", "flags", "compiler", "environment", "nothing"])
def test_whatever_a_model_follows_from_makes_another_library(change, calls, tmp_path, monkeypatch):
    engine = tmp_path / "engine"
    shutil.copytree(libraries.ENGINE_FOLDERS[0], engine)
    monkeypatch.setattr(libraries, "ENGINE_FOLDERS", (engine,))
    first, source = model_library(TINY), TINY
    if change == "source":
        source = TINY.replace("Tiny", "Other")
    elif change == "header":
        (engine / "model.h").write_text((engine / "model.h").read_text() + "/* another */\n")
    elif change == "flags":
        monkeypatch.setattr(libraries, "_MODEL_FLAGS", (*libraries._MODEL_FLAGS, "-fno-builtin"))
    elif change == "compiler":
        script = Path(os.environ["CC"])
        script.write_text(script.read_text() + "# another version\n")
    elif change == "environment":
        monkeypatch.setenv("CPATH", str(tmp_path))
    second = model_library(source)
    assert (second == first) is (change == "nothing")
    assert len(calls()) == (1 if change == "nothing" else 2)


def test_without_a_compiler_the_sentence_says_what_to_install(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for library in (engine_library, lambda: model_library(TINY)):
        with pytest.raises(BuildError, match=r"^No C compiler was found: .*Remedy: install a C compiler"):
            library()


def test_what_does_not_compile_is_told_and_not_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("HYBRID_FMU_CACHE", str(tmp_path))
    with pytest.raises(BuildError, match=r"(?s)failed to compile the model.*missing"):
        model_library(TINY + "int broken(void) { return missing; }\n")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
