"""Names follow the convention that the description declares, whatever a variable is called."""

import pytest
from fmpy.validation import _validate_variable_names
from hypothesis import given
from hypothesis import strategies as st

from fmu.describe.names import structured_name, variable_names
from fmu.errors import ExportError


class Described:
    """As much of a description as fmpy's grammar of names looks at."""

    def __init__(self, names, convention):
        self.variableNamingConvention = convention
        self.modelVariables = [type("V", (), {"name": name, "sourceline": 1})() for name in names]


@pytest.mark.parametrize(
    "name", ["x", "_x", "w[2]", "m[2,1]", "agent1.x", "der(x)", "der(agent1.w[2])", "margin.jump", "'a b'.c", "int"]
)
def test_legal_names_stay_as_they_are(name):
    assert structured_name(name) == name


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("a b", "'a b'"),
        ("2nd", "'2nd'"),
        ("*/", "'*/'"),
        ("a b[3]", "'a b'[3]"),
        ("margin.hits the floor", "margin.'hits the floor'"),
        ("der(a b)", "der('a b')"),
        ("der(der(x))", "'der(der(x))'"),
        ('say "x"', "'say \\\"x\\\"'"),
        ("it's", "'it\\'s'"),
        ("%s%n", "'%s%n'"),
        ("x[", "'x['"),
        ("tab\there", "'tab\\there'"),
    ],
)
def test_hostile_names_are_quoted(name, written):
    assert structured_name(name) == written


@pytest.mark.parametrize("name", ["ω", "a`b", "", "a..b", "a\0b"])
def test_what_the_structured_convention_cannot_write(name):
    assert structured_name(name) is None


def test_one_name_beyond_ascii_makes_all_names_flat():
    assert variable_names("Block", ["ω", "a b", "x"]) == (["ω", "a b", "x"], "flat")
    assert variable_names("Block", ["a b", "x"]) == (["'a b'", "x"], "structured")


def test_names_that_come_twice_are_refused():
    with pytest.raises(ExportError, match="two variables called 'x'"):
        variable_names("Block", ["x", "y", "x"])
    # The second is called so from the start.
    with pytest.raises(ExportError, match="two variables called \"'a b'\""):
        variable_names("Block", ["a b", "'a b'"])


@pytest.mark.parametrize(("name", "told"), [("", "without a name"), ("a\0b", "cannot hold"), ("ω\n", "cannot hold")])
def test_what_no_convention_takes_is_refused(name, told):
    with pytest.raises(ExportError, match=told):
        variable_names("Block", ["x", name])


def test_messages_stay_short():
    with pytest.raises(ExportError, match=r"10001 characters") as caught:
        variable_names("Block", ["ω" * 10000 + "\n"])
    assert len(str(caught.value)) < 300


@given(st.lists(st.text(min_size=1, max_size=30), min_size=1, max_size=4))
def test_every_name_is_legal_by_the_declared_convention_or_refused(names):
    try:
        written, convention = variable_names("Block", names)
    except ExportError:
        return
    assert len(set(written)) == len(names)
    assert _validate_variable_names(Described(written, convention)) == []


@given(st.text(alphabet=st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="`"), min_size=1))
def test_printable_ascii_but_the_backtick_is_always_structured(name):
    """Only empty parts between dots have no place."""
    written = structured_name(name)
    assert written is not None or "" in name.split(".")


@given(st.text(max_size=30))
def test_writing_a_name_twice_changes_nothing(name):
    written = structured_name(name)
    assert written is None or structured_name(written) == written
