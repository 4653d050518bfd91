"""docs/commands.md, which is read in the repository too, says what the commands say of themselves."""

from command_help import PAGE, page


def test_the_page_is_what_the_commands_print():
    """Word for word; where lines are broken differs between versions of Python."""
    remedy = "run .venv/bin/python tests/support/command_help.py"
    assert PAGE.read_text(encoding="utf-8").split() == page().split(), remedy
