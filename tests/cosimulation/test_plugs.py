"""Terminals of FMUs that are connected by their names: by each rule, both ways, and what is refused."""

import zipfile

import pytest

import hybrid_model as hm
from cosim.cli.main import main
from cosim.errors import MisfitError
from cosim.masters import run_event_exact
from cosim.systems.assembly import assemble
from cosim.systems.definition import Component, SystemDefinition
from cosim.systems.toml_file import read_toml
from fmu.importer.terminals import FILE, Terminal, read_terminals

XML = '<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{}</Terminals></fmiTerminalsAndIcons>'
SENT, HEARD, ECHO, ASKED = "sent", "int32_in", "boolean_out", "boolean_in"


def terminal(name, rule, members, kind="signal", within=""):
    lines = (
        f'<TerminalMemberVariable variableName="{variable}" memberName="{member}" variableKind="{kind}"/>'
        for member, variable in members.items()
    )
    return f'<Terminal name="{name}" matchingRule="{rule}">{"".join(lines)}{within}</Terminal>'


@pytest.fixture
def pair(stranger):
    """Two FMUs with one terminal each, wired."""

    def make(one, other, wire=("b.plug", "a.plug"), more=None):
        components = []
        for name, written in (("a", one), ("b", other)):
            path = stranger(name)
            with zipfile.ZipFile(path, "a") as archive:
                archive.writestr(FILE, XML.format(written))
            components.append(Component(name, "fmu", str(path)))
        components[0].start["boolean_in"] = True
        return assemble(SystemDefinition("pair", components, dict([wire]) | (more or {})))

    return make


@pytest.mark.parametrize("rule", ["plug", "bus", "sequence"])
def test_members_are_connected_by_each_rule_whichever_is_the_output(rule, pair):
    one, other = {"value": SENT, "answer": ASKED}, {"value": HEARD, "answer": ECHO}
    if rule == "bus":
        one["alone"] = "x"
    if rule == "sequence":
        other = dict(zip("pq", other.values(), strict=True))
    system = pair(terminal("plug", rule, one), terminal("plug", rule, other))
    assert sorted(map(str, system.connections)) == ["a.sent -> b.int32_in", "b.boolean_out -> a.boolean_in"]
    result = run_event_exact(system, 2.5)
    assert (result.final["a.sent"], result.final["b.int32_out"]) == (2, 2)
    # The value that `a` began with has given way to the one that `b` sends.
    assert result.final["a.boolean_out"] is False


def test_terminals_in_terminals_have_names_with_points(pair):
    outer = [terminal("plug", "plug", {}, within=terminal("in", "plug", {"value": v})) for v in (SENT, HEARD)]
    for wire in (("b.plug.in", "a.plug.in"), ("b.plug", "a.plug")):
        assert [str(c) for c in pair(*outer, wire=wire).connections] == ["a.sent -> b.int32_in"]


@pytest.mark.parametrize(
    ("one", "other", "sentence"),
    [
        (("plug", {"v": SENT}), ("bus", {"v": HEARD}), "match by 'plug' and 'bus'"),
        (("own", {"v": SENT}), ("own", {"v": HEARD}), "give two of one of plug, bus, sequence"),
        (("plug", {"v": SENT, "w": ECHO}), ("plug", {"v": HEARD}), "the member w is in one of the terminals only"),
        (
            ("plug", {"v": SENT}),
            ("plug", {"v": SENT}),
            "a.plug -> b.plug: v is a.sent and b.sent, and not an output and",
        ),
        (("bus", {"v": SENT}), ("bus", {"w": HEARD}), "the terminals have no signals in common"),
        (
            ("plug", {"v": SENT}, "inflow"),
            ("plug", {"v": HEARD}, "inflow"),
            "of kind 'inflow' and 'inflow', and signals",
        ),
    ],
)
def test_what_does_not_match_is_refused(one, other, sentence, pair):
    with pytest.raises(MisfitError, match=sentence):
        pair(terminal("plug", *one), terminal("plug", *other))


def test_a_terminal_is_connected_to_a_terminal(pair):
    one, other = (terminal("plug", "plug", {"v": v}) for v in (SENT, HEARD))
    with pytest.raises(MisfitError, match=r"b\.plug is a terminal, and is to be connected to 'a\.sent'"):
        pair(one, other, wire=("b.plug", "a.sent"))
    with pytest.raises(MisfitError, match=r"a\.sent -> b\.int32_in.* is driven twice"):
        pair(one, other, wire=("b.plug", "a.plug"), more={"b.int32_in": "a.sent"})
    with pytest.raises(MisfitError, match=r"b\.plgu is not an input"):
        pair(one, other, wire=("b.plgu", "a.plug"))


def test_a_doctype_in_them_is_refused(pair):
    with pytest.raises(MisfitError, match=r"b: its terminals cannot be read: .* is no XML"):
        pair("", "<Terminal>")


class Talks(hm.HybridAutomaton):
    count = hm.DiscreteState(0.0)
    word = hm.Output(discrete=True)
    heard = hm.Input(0.0, discrete=True)

    def outputs(self, s):
        return {"word": s.count}

    transitions = (hm.TimeEvent("speak", lambda self, s: s.count + 1.0, lambda self, s: {"count": s.count + 1.0}),)


def test_terminals_of_our_fmus_are_read(exported, tmp_path, capsys):
    found = read_terminals(exported(Talks()))
    assert found["heard"] == Terminal("bus", {"value": ("heard", "signal")})
    assert found["word"].members["value"] == ("word", "signal")
    (tmp_path / "system.toml").write_text(
        "".join(f"[components.{name}]\nfmu = {str(exported(Talks()))!r}\n" for name in "ab")
        + '[connections]\n"b.heard" = "a.word"\n'
    )
    assert [str(c) for c in assemble(read_toml(tmp_path / "system.toml")).connections] == ["a.word -> b.heard"]
    assert main(["cosim", str(tmp_path), "--stop-time", "2.5"]) == 0
    assert "a.word = 2" in capsys.readouterr().out
