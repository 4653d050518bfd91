"""What is in an FMU's binary: FMI functions and nothing else, no Python, the same bytes every time."""

import re
import subprocess
import zipfile

import pytest
from catalogue import cases

from fmu.build import fmi_headers
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall


@pytest.fixture
def binary(exported, tmp_path):
    with zipfile.ZipFile(exported(cases()["agent2_dynamic"].automaton, "agent2_dynamic")) as archive:
        [member] = [name for name in archive.namelist() if name.startswith("binaries/")]
        return archive.extract(member, tmp_path)


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_all_fmi3_functions_and_nothing_else_are_exported(binary):
    names = re.findall(r" [A-Z] (\S+)$", run("nm", "-D", "--defined-only", binary), flags=re.MULTILINE)
    header = (fmi_headers() / "fmi3Functions.h").read_text()
    assert sorted(names) == sorted(set(re.findall(r"^#define (fmi3\w+)\s+fmi3FullName", header, flags=re.MULTILINE)))


def test_needs_the_c_library_only(binary):
    needed = re.findall(r"Shared library: \[(.*)\]", run("readelf", "-d", binary))
    assert {name.split(".")[0] for name in needed} <= {"libc", "libm"}
    assert not re.search("RPATH|RUNPATH|TEXTREL", run("readelf", "-d", binary))


def test_two_exports_give_the_same_bytes(tmp_path):
    first = export_fmu(BouncingBall(), tmp_path / "one" / "ball.fmu").read_bytes()
    second = export_fmu(BouncingBall(), tmp_path / "another" / "ball.fmu").read_bytes()
    assert first == second


def test_the_token_changes_with_the_model(tmp_path):
    def token(ball):
        with zipfile.ZipFile(export_fmu(ball, tmp_path / "ball.fmu")) as archive:
            return re.search(rb'instantiationToken="(\w+)"', archive.read("modelDescription.xml"))[1]

    assert token(BouncingBall()) == token(BouncingBall()) != token(BouncingBall(e=0.8))
