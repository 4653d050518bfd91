"""Which compiler there is, and how it is told from another."""

import os
import sys

import pytest

from hybrid_model.errors import BuildError
from hybrid_model.native.build import compiler
from hybrid_model.native.build.compiler import compiler_identity, find_compiler, is_zig


def test_compiler_is_taken_from_the_environment(monkeypatch):
    monkeypatch.setenv("CC", f"{find_compiler()[0]} -pipe")
    assert find_compiler()[1:] == ["-pipe"]
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(BuildError, match=r"CC is 'no-such-compiler'.*Remedy"):
        find_compiler()


def test_no_compiler_says_what_to_install(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(BuildError, match=r"Remedy: install a C compiler"):
        find_compiler()


def test_ziglang_is_the_last_resort(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: object() if name == "ziglang" else None)
    assert find_compiler()[1:] == ["-m", "ziglang", "cc"]


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (["python", "-m", "ziglang", "cc"], True),
        (["/opt/zig/zig", "cc"], True),
        (["C:/zig.exe", "cc"], True),
        (["cc"], False),
        (["gcc", "-pipe"], False),
        (["/home/zig/bin/gcc"], False),
    ],
)
def test_zig_is_recognised_by_its_command(command, answer):
    assert is_zig(command) is answer


# ---- which one it is ----

posix = pytest.mark.skipif(sys.platform == "win32", reason="compilers are shell scripts here")


def program(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    # The time of a file may be coarse.
    os.utime(path, ns=(1, 1))
    return path


@posix
def test_another_file_is_another_compiler(tmp_path):
    path = program(tmp_path / "gcc", "exit 1")
    first = compiler_identity([str(path)])
    assert compiler_identity([str(path)]) == first
    os.utime(path, ns=(2, 2))
    assert compiler_identity([str(path)]) != first


@posix
def test_a_link_to_another_compiler_is_noticed(tmp_path):
    link = tmp_path / "cc"
    link.symlink_to(program(tmp_path / "gcc-12", "exit 1"))
    first = compiler_identity([str(link)])
    link.unlink()
    link.symlink_to(program(tmp_path / "gcc-13", "exit 1"))
    assert compiler_identity([str(link)]) != first


@posix
def test_a_compiler_behind_another_program_is_noticed(tmp_path):
    """ccache and its like stay the same when the compiler behind them changes."""
    version = tmp_path / "version"
    version.write_text("12")
    wrapper = program(tmp_path / "wrapper", f'cat "{version}"')
    first = compiler_identity([str(wrapper)])
    version.write_text("13")
    # A process asks once.
    compiler._version.cache_clear()
    assert compiler_identity([str(wrapper)]) != first


@posix
def test_programs_named_as_arguments_count(tmp_path):
    launcher, behind = program(tmp_path / "launcher", "exit 0"), program(tmp_path / "gcc", "exit 0")
    first = compiler_identity([str(launcher), str(behind)])
    os.utime(behind, ns=(2, 2))
    assert compiler_identity([str(launcher), str(behind)]) != first


@posix
@pytest.mark.parametrize("name", ["gcc", "gcc-12", "x86_64-linux-gnu-gcc-12", "clang-19", "clang"])
def test_compilers_are_not_started_to_know_them(name, tmp_path):
    """Looking up what was kept takes no process."""
    if sys.platform == "darwin":
        pytest.skip("compilers of macOS are chosen by a program in their place")
    log = tmp_path / "log"
    compiler_identity([str(program(tmp_path / name, f'touch "{log}"'))])
    assert not log.exists()
