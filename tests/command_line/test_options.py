"""Help and refusals: what is told without the imports that runs need, and what the options say of themselves."""

import argparse
import json
import os
import resource
import socket
import subprocess
import sys

import pytest

from cosim.cli.main import COMMANDS, main, parser_of
from cosim.cli.options import certify, cosimulate, sweep, validate
from cosim.isolation import isolated_slave
from cosim.masters.fixed_step import ORDERS
from fmu.validate.smoke.child_process import RunLimits
from hybrid_model.consensus.certificates import analysis
from hybrid_model.consensus.sweeps.designs import Design

PARSER = parser_of(tuple(COMMANDS))
(GROUP,) = [action for action in PARSER._actions if isinstance(action, argparse._SubParsersAction)]


@pytest.mark.parametrize(
    ("call", "status", "heavy"),
    [
        (["--help"], 0, ()),
        (["bogus"], 2, ()),
        *(([command, "--help"], 0, ()) for command in COMMANDS),
        (["simulate", "paper-a", "--stop-time", "x"], 2, ()),
        (["validate", "missing.fmu"], 2, ()),
        (["simulate", "missing"], 2, ("hybrid_model",)),
    ],
    ids=lambda value: " ".join(map(str, value)) if isinstance(value, list) else None,
)
def test_help_and_refusals_come_without_the_heavy_imports(call, status, heavy):
    program = (
        "import sys\nfrom cosim.cli.main import main\n"
        "try: status = main(sys.argv[1:])\nexcept SystemExit as e: status = e.code\n"
        "names = [n for n in ('hybrid_model', 'scipy', 'networkx', 'matplotlib', 'casadi', 'control', 'fmpy') "
        "if n in sys.modules]\nprint(status, *names, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program, *call], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1].split() == [str(status), *heavy]


def test_options_say_what_the_library_does():
    assert cosimulate.ORDERS == ORDERS
    assert cosimulate.PATIENCE == isolated_slave.PATIENCE
    assert certify.PATIENCE == analysis.PATIENCE
    assert [design.value for design in Design] == list(sweep.DESIGNS)
    assert (RunLimits.seconds, RunLimits.memory >> 20) == (validate.SECONDS, validate.MEBIBYTES)


@pytest.mark.parametrize("command", COMMANDS)
def test_each_option_has_help_and_tells_its_default(command):
    parser = GROUP.choices[command]
    assert "examples:\n  hybrid-fmu " in parser.format_help()
    assert "Exit status: 0 done, 1 failed, 2 wrong usage, 3 stopped by a Zeno guard, 130" in parser.format_help()
    for action in parser._actions:
        assert action.help, action.dest
        if action.default not in (None, False, [], "", argparse.SUPPRESS):
            assert "%(default)s" in action.help, action.dest


@pytest.mark.parametrize("command", COMMANDS)
def test_examples_are_calls(command, monkeypatch):
    """Each parses, and names files or scenarios of the right kind."""
    module = sys.modules[f"cosim.cli.options.{COMMANDS[command][0]}"]
    for example in module.EXAMPLES:
        words = example.partition(" > ")[0].split()
        assert words[0] == "hybrid-fmu"
        assert PARSER.parse_args(words[1:]).command == command


def test_json_everywhere():
    assert [name for name, parser in GROUP.choices.items() if "--json" not in parser.format_help()] == [
        "app",
        "completion",
    ]


def test_doctor_tells_what_there_is(capsys):
    assert main(["doctor", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["run"]["native"]
    assert found["run"]["events"] == 1
    assert found["python"]["version"] == ".".join(map(str, sys.version_info[:3]))
    assert found["packages"]["numpy"]
    assert "this machine" in found["platforms"].values()
    assert found["extras"]["data"]["pandas"]
    assert main(["doctor"]) == 0
    assert "FMUs for" in capsys.readouterr().out


def test_the_page_needs_a_port_that_is_free(capsys):
    pytest.importorskip("marimo")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        for port in (taken.getsockname()[1], 99999):
            assert main(["app", "--no-browser", "--port", str(port)]) == 2
            told = capsys.readouterr()
            assert not told.out
            assert f"port {port} of this machine" in told.err
            assert "give another one, --port N" in told.err


def test_doctor_without_a_compiler(monkeypatch, capsys):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("PATH", os.devnull)
    assert main(["doctor", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)["compiler"]
    assert not found["found"]
    assert found["remedy"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "tcsh"])
def test_completion_knows_commands_and_options(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(command in script for command in COMMANDS)
    assert "output-interval" in script


def test_completion_in_bash(capsys, tmp_path):
    """Bash itself completes a command, an option, and the name of a preset."""
    assert main(["completion", "bash"]) == 0
    (tmp_path / "c").write_text(capsys.readouterr().out)
    ask = (
        f"source {tmp_path}/c; f=$(complete -p hybrid-fmu | sed 's/.*-F \\([^ ]*\\).*/\\1/');"
        'for line in "sim" "simulate --output-i" "simulate paper-a-dwell-t"; do COMP_WORDS=(hybrid-fmu $line);'
        " COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=(); $f; echo ${COMPREPLY[@]}; done"
    )
    done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=False)
    assert done.stdout.split("\n")[:3] == ["simulate", "--output-interval", "paper-a-dwell-two-pi"]


def test_help_takes_little_time():
    """A tenth of the limit of 0.35 s, on the machine on which this was written; CPU time, not that of the clock."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "cosim.cli.main", "--help"], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.35
