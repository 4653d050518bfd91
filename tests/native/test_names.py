"""Names as pairs of places in one text."""

import re

import pytest

from hybrid_model.native.names import NameTable

NAMES = ["x", "agent1.x", "agent1.weights.phase[3]", "der(agent2.x)", "margin.agent2.jump", "Höhe.h", 'a."b"\\?', ""]


def text_of(table):
    """The bytes that a C compiler makes of the definition."""
    body = re.fullmatch(r"static const char names\[\] = \{\n(.*)\n\};\n", table.definition("names"), re.DOTALL)
    octets = body[1].replace(" ", "").replace("\n", "").strip(",").split(",")
    return bytes(int(octet[2:-1], 8) if octet.startswith("'\\") else int(octet) for octet in octets)


def c_string(text, place):
    return text[place : text.index(0, place)]


def test_names_come_back():
    table = NameTable()
    pairs = [table.pair(name) for name in NAMES]
    text = text_of(table)
    assert len(text) == table.size
    for name, (head, tail) in zip(NAMES, pairs, strict=True):
        assert table.name(head, tail) == name
        # What printf("%s%s", text + head, text + tail) writes.
        assert (c_string(text, head) + c_string(text, tail)).decode() == name
    assert [table.entry(name) for name in NAMES] == [f"{{{head}, {tail}}}" for head, tail in pairs]


def test_heads_and_tails_are_kept_once():
    table = NameTable()
    for part in range(1, 1001):
        for k in range(1, 31):
            table.pair(f"agent{part}.weights.duty_percent[{k}]")
    # Heads "agent<n>.weights." for a thousand agents, and thirty tails.
    heads = sum(len(f"agent{part}.weights.") + 1 for part in range(1, 1001))
    assert table.size == heads + sum(len(f"duty_percent[{k}]") + 1 for k in range(1, 31))


@pytest.mark.parametrize("names", [[], [""]])
def test_a_table_without_text_is_still_an_array(names):
    table = NameTable()
    for name in names:
        table.pair(name)
    assert text_of(table) == b"\0"
    assert table.size == len(names)
