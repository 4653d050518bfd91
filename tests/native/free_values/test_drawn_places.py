"""A number that a map reads may lie anywhere: in containers, objects and functions, one within the other."""

import itertools
import types

import pytest
from hypothesis import given
from hypothesis import strategies as st
from notebook import Notebook

from hybrid_model.native.free_values.snapshots import snapshot, why_untold

KINDS = """
import functools
from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace

class Box:
    def __init__(self, held): self.held = held
    def get(self): return self.held

class Slotted:
    __slots__ = ("held",)
    def __init__(self, held): self.held = held

class Computed:
    def __init__(self, held): self._held = held
    @property
    def held(self): return self._held

class Stack(list): pass

class Indexed:
    def __init__(self, held): self._held = held
    def __getitem__(self, index): return self._held

@dataclass(frozen=True)
class Frozen:
    held: object

def closure(held): return lambda: held
def default(held): return eval("lambda value=held: value", {"held": held})
def keyword(held):
    def get(*, value=held): return value
    return get
def identity(value): return value
def module(held):
    made = ModuleType("made")
    made.held = held
    return made
def named(held):
    def get(): return get.held
    get.held = held
    return get
def made_class(held): return type("Made", (), {"held": held})
"""

CHANGEABLE = {
    "list": ("[{}]", "[0]", "{}[0] = {}"),
    "dict": ("{{'a': {}}}", "['a']", "{}['a'] = {}"),
    "box": ("Box({})", ".held", "{}.held = {}"),
    "method": ("Box({}).get", "()", "{}.__self__.held = {}"),
    "slots": ("Slotted({})", ".held", "{}.held = {}"),
    "property": ("Computed({})", ".held", "{}._held = {}"),
    "subclass": ("Stack([{}])", "[0]", "{}[0] = {}"),
    "operator": ("Indexed({})", "[7]", "{}._held = {}"),
    "frozen": ("Frozen({})", ".held", "object.__setattr__({}, 'held', {})"),
    "namespace": ("SimpleNamespace(held={})", ".held", "{}.held = {}"),
    "closure": ("closure({})", "()", "{}.__closure__[0].cell_contents = {}"),
    "default": ("default({})", "()", "{}.__defaults__ = ({},)"),
    "keyword": ("keyword({})", "()", "{}.__kwdefaults__['value'] = {}"),
    "partial": ("functools.partial(identity, value={})", "()", "{}.keywords['value'] = {}"),
    "module": ("module({})", ".held", "{}.held = {}"),
    "attribute of a function": ("named({})", "()", "{}.held = {}"),
    "class": ("made_class({})", ".held", "{}.held = {}"),
    "view": ("MappingProxyType(below := {{'a': {}}})", "['a']", None),
    "tuple": ("({},)", "[0]", None),
    "object array": ("np.array([{}, None], dtype=object)", "[0]", "{}[0] = {}"),
}
ROOTS = {
    "global": ("root = {}", "root", "root = {}"),
    "instance": ("block.root = {}", "self.root", "block.root = {}"),
    # A function in a class would be a method.
    "class": ("Block.root = ({},)", "self.root[0]", "Block.root = ({},)"),
    "helper": ("root = {}", "(lambda: helper())()", "root = {}"),
    "static method": ("root = {}", "self.static()", "root = {}"),
}
BLOCK = """
class Block(hm.HybridAutomaton):
    x = hm.State(1.0)
    def flow_map(self, s): return {{"x": -{} * s.x}}
    @staticmethod
    def static(): return root
def helper(): return root
block = Block()
unrelated = [1.0]
"""


class Place:
    """A number in nested containers, as text."""

    def __init__(self, root, kinds):
        self.root, self.kinds = ROOTS[root], [CHANGEABLE[kind] for kind in kinds]

    def value(self, number, depth=0):
        text = number
        for make, _, _ in reversed(self.kinds[depth:]):
            text = make.format(text)
        return text

    def notebook(self):
        read = self.root[1] + "".join(suffix for _, suffix, _ in self.kinds)
        notebook = Notebook(KINDS, BLOCK.format(read))
        notebook.names["ModuleType"] = types.ModuleType
        notebook.run(self.root[0].format(self.value("2.5")))
        return notebook

    def change(self, number, depth):
        """Put the number anew into its place, with all that lies `depth` levels below the root and deeper."""
        if depth == 0 or self.kinds[depth - 1][2] is None:
            return self.root[2].format(self.value(number))
        owner = self.root[1].replace("self.static()", "root").replace("(lambda: helper())()", "root")
        owner = owner.replace("self.root", "block.root")
        owner += "".join(suffix for _, suffix, _ in self.kinds[: depth - 1])
        return self.kinds[depth - 1][2].format(owner, self.value(number, depth))


@st.composite
def places(draw):
    kinds = draw(st.lists(st.sampled_from(sorted(CHANGEABLE)), max_size=4))
    # An array of objects takes lists apart.
    for outer, inner in itertools.pairwise(kinds):
        if outer == "object array" and inner in ("list", "tuple", "subclass", "object array", "operator"):
            kinds = kinds[:1]
            break
    return Place(draw(st.sampled_from(sorted(ROOTS))), kinds), draw(st.integers(0, len(kinds)))


@given(places())
def test_a_number_is_seen_wherever_it_lies(drawn):
    place, depth = drawn
    notebook = place.notebook()
    block = notebook["block"]
    then = snapshot(block)
    assert then is not None, why_untold(block)
    assert then.still_holds()
    notebook.run("unrelated[0] = 2.0\nunrelated = None\nother = Block()\nother.root = 1.0")
    assert then.still_holds()
    notebook.run(place.change("2.5", depth))
    assert snapshot(block).key == then.key, "equal values give an equal key"
    notebook.run(place.change("7.5", depth))
    assert not then.still_holds()
    assert snapshot(block).key != then.key
    notebook.run(place.change("2.5", depth))
    assert snapshot(block).key == then.key


@pytest.mark.parametrize("kind", CHANGEABLE)
@pytest.mark.parametrize("root", ROOTS)
def test_each_kind_of_place_is_read_by_the_map(root, kind):
    place = Place(root, [kind])
    notebook = place.notebook()
    block = notebook["block"]
    then = snapshot(block)
    assert then is not None, why_untold(block)
    rates = []
    for number in ("2.5", "7.5"):
        notebook.run(place.change(number, 1))
        rates.append(block.flow_map(types.SimpleNamespace(x=1.0)))
    assert rates == [{"x": -2.5}, {"x": -7.5}]
    assert not then.still_holds()
    assert snapshot(block).key != then.key
