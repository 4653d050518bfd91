"""Which compiler there is, and how it is told from another."""

import pytest

from hybrid_model.errors import BuildError
from hybrid_model.native.build.compiler import find_compiler, is_zig


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
