"""Whatever changes the trace of an automaton changes its snapshot, and what does not leaves the key as it is."""

import textwrap

import numpy as np
import pytest
from notebook import Notebook

import hybrid_model as hm
from hybrid_model.native.free_values.snapshots import snapshot
from hybrid_model.native.trace import trace


def model(before, body, rate):
    """A falling ball whose rate is an expression of what a cell defines."""
    return "\n".join(
        [
            textwrap.dedent(before),
            "class Ball(hm.HybridAutomaton):",
            "    h = hm.State(1.0)",
            "    v = hm.State(0.0)",
            "    e = hm.Parameter(0.7)",
            textwrap.indent(textwrap.dedent(body), "    "),
            "    def flow_map(self, s):",
            f"        return {{'h': s.v, 'v': {rate}}}",
            "    def jump_set(self, s):",
            "        return -s.h",
            "    def jump_map(self, s):",
            "        return {'v': -s.e * s.v}",
            "ball = Ball()",
        ]
    )


def expressions(automaton):
    return [function.serialize() for function in trace(automaton).functions]


NOTICED = {
    "a global": ("G = 9.81", "", "-G", "G = 1.62"),
    "a global that hides a builtin": ("", "", "-1.0 * abs(-2.0)", "def abs(x): return 7.0"),
    "a global array, in place": ("G = np.array([9.81, 0.0])", "", "-G[0]", "G[0] = 1.62"),
    "the base of a view": ("whole = np.array([0.0, 9.81]); G = whole[1:]", "", "-G[0]", "whole[1] = 1.62"),
    "an array of objects": ("G = np.array([9.81, None], dtype=object)", "", "-G[0]", "G[0] = 1.62"),
    "a global list": ("G = [9.81]", "", "-G[0]", "G[0] = 1.62"),
    "a global dictionary": ("G = {'earth': 9.81}", "", "-G['earth']", "G['earth'] = 1.62"),
    "a dictionary in a list in a dictionary": ("G = {'a': [{'g': 9.81}]}", "", "-G['a'][0]['g']", "G['a'][0]['g'] = 1"),
    "a set": ("G = {1.0, 2.0}", "", "-sum(G)", "G.add(4.0)"),
    "a deque": ("from collections import deque\nG = deque([1.0])", "", "-sum(G)", "G.append(4.0)"),
    "a default dictionary": (
        "from collections import defaultdict\nG = defaultdict(lambda: 9.81)",
        "",
        "-dict(G).get('g', G.default_factory())",
        "G.default_factory = lambda: 1.62",
    ),
    "a closure": (
        """
        def gravity():
            g = 9.81
            def now(): return g
            def set(value):
                nonlocal g
                g = value
            return now, set
        now, set_gravity = gravity()
        """,
        "",
        "-now()",
        "set_gravity(1.62)",
    ),
    "a default": ("def fall(g=9.81): return g", "", "-fall()", "fall.__defaults__ = (1.62,)"),
    "a default that is a list": ("def fall(g=[9.81]): return g[0]", "", "-fall()", "fall.__defaults__[0][0] = 1.62"),
    "a keyword default": ("def fall(*, g=9.81): return g", "", "-fall()", "fall.__kwdefaults__['g'] = 1.62"),
    "an attribute of a function": ("def fall(): return fall.g\nfall.g = 9.81", "", "-fall()", "fall.g = 1.62"),
    "the code of a function": (
        "def fall(): return 9.81",
        "",
        "-fall()",
        "def other(): return 1.62\nfall.__code__ = other.__code__",
    ),
    "a helper written anew": ("def fall(): return 9.81", "", "-fall()", "def fall(): return 1.62"),
    "a helper of a helper": (
        "def inner(): return 9.81\ndef fall(): return 2 * inner()",
        "",
        "-fall()",
        "def inner(): return 1.62",
    ),
    "what a helper reads": ("G = 9.81\ndef fall(): return G", "", "-fall()", "G = 1.62"),
    "what a nested function reads": ("G = 9.81", "", "-(lambda: [G for _ in range(1)][0])()", "G = 1.62"),
    "helpers that call each other": (
        "G = 9.81\ndef even(n): return G if n == 0 else odd(n - 1)\ndef odd(n): return 0.0 if n == 0 else even(n - 1)",
        "",
        "-even(4)",
        "G = 1.62",
    ),
    "an attribute of the instance": ("", "g = 9.81", "-self.g", "ball.g = 1.62"),
    "an attribute of the class": ("", "g = 9.81", "-self.g", "Ball.g = 1.62"),
    "an attribute behind another name": ("", "g = 9.81", "-getattr(self, 'g')", "ball.g = 1.62"),
    "an attribute with a computed name": ("", "g1 = 9.81", "-getattr(self, f'g{1}')", "ball.g1 = 1.62"),
    "an attribute found by attrgetter": (
        "import operator",
        "g = 9.81",
        "-operator.attrgetter('g')(self)",
        "ball.g = 1.62",
    ),
    "an attribute in a text": ("", "g = 9.81", "-float('{0.g}'.format(self))", "ball.g = 1.62"),
    "an attribute that appears": ("", "", "-getattr(self, 'g', 9.81)", "ball.g = 1.62"),
    "the dictionary of the instance": ("", "", "-self.__dict__.get('g', 9.81)", "ball.g = 1.62"),
    "vars of the instance": ("", "", "-vars(self).get('g', 9.81)", "ball.g = 1.62"),
    "deep inside an attribute": (
        "class Planet:\n    def __init__(self): self.surface = {'g': [9.81]}",
        "planet = Planet()",
        "-self.planet.surface['g'][0]",
        "ball.planet.surface['g'][0] = 1.62",
    ),
    "an object with slots": (
        "class Planet:\n    __slots__ = ('g',)\nplanet = Planet()\nplanet.g = 9.81",
        "",
        "-planet.g",
        "planet.g = 1.62",
    ),
    "the class of an object": (
        "class Earth:\n    g = 9.81\nclass Moon:\n    g = 1.62\nplanet = Earth()",
        "",
        "-planet.g",
        "planet.__class__ = Moon",
    ),
    "a new dictionary of the instance": (
        "",
        "",
        "-vars(self).get('g', 9.81)",
        "ball.__dict__ = {**vars(ball), 'g': 1.62}",
    ),
    "a new dictionary of a function": (
        "def fall(): return fall.g\nfall.g = 9.81",
        "",
        "-fall()",
        "fall.__dict__ = {'g': 1.62}",
    ),
    "a namespace": ("import types\nG = types.SimpleNamespace(g=9.81)", "", "-G.g", "G.g = 1.62"),
    "a dataclass": (
        "from dataclasses import dataclass\n@dataclass\nclass Planet:\n    g: float = 9.81\nplanet = Planet()",
        "",
        "-planet.g",
        "planet.g = 1.62",
    ),
    "a frozen dataclass that is replaced": (
        "import dataclasses\n@dataclasses.dataclass(frozen=True)\nclass Planet:\n    g: float\nplanet = Planet(9.81)",
        "",
        "-planet.g",
        "planet = dataclasses.replace(planet, g=1.62)",
    ),
    "a list in a frozen dataclass": (
        "import dataclasses\n@dataclasses.dataclass(frozen=True)\nclass Planet:\n    g: list\nplanet = Planet([9.81])",
        "",
        "-planet.g[0]",
        "planet.g[0] = 1.62",
    ),
    "a dataclass taken apart": (
        "import dataclasses\n@dataclasses.dataclass\nclass Planet:\n    g: float = 9.81\nplanet = Planet()",
        "",
        "-sum(dataclasses.astuple(planet))",
        "planet.g = 1.62",
    ),
    "the default of a dataclass that is made": (
        "G = 9.81\nclass Planet:\n    def __init__(self): self.g = G",
        "",
        "-Planet().g",
        "G = 1.62",
    ),
    "a named tuple that is replaced": (
        "from typing import NamedTuple\nclass Planet(NamedTuple):\n    g: float\nplanet = Planet(9.81)",
        "",
        "-planet.g",
        "planet = Planet(1.62)",
    ),
    "a list in a named tuple": (
        "from typing import NamedTuple\nclass Planet(NamedTuple):\n    g: list\nplanet = Planet([9.81])",
        "",
        "-planet.g[0]",
        "planet.g[0] = 1.62",
    ),
    "a subclass of list": ("class Stack(list): pass\nG = Stack([9.81])", "", "-G[0]", "G[0] = 1.62"),
    "a subclass of dict with attributes": ("class Bag(dict): pass\nG = Bag()\nG.g = 9.81", "", "-G.g", "G.g = 1.62"),
    "another member of an enum": (
        "import enum\nclass Planet(enum.Enum):\n    EARTH = 9.81\n    MOON = 1.62\nplanet = Planet.EARTH",
        "",
        "-planet.value",
        "planet = Planet.MOON",
    ),
    "what a member of an enum holds": (
        "import enum\nclass Planet(enum.Enum):\n    EARTH = {'g': 9.81}",
        "",
        "-Planet.EARTH.value['g']",
        "Planet.EARTH.value['g'] = 1.62",
    ),
    "what a property reads": ("G = 9.81", "@property\ndef g(self): return G", "-self.g", "G = 1.62"),
    "another property": ("", "@property\ndef g(self): return 9.81", "-self.g", "Ball.g = property(lambda self: 1.62)"),
    "a cached property, when it is forgotten": (
        "import functools\nG = 9.81",
        "@functools.cached_property\ndef g(self): return G",
        "-self.g",
        "G = 1.62\nvars(ball).pop('g')",
    ),
    "a descriptor of the user": (
        "G = 9.81\nclass Gravity:\n    def __get__(self, owner, cls): return G",
        "g = Gravity()",
        "-self.g",
        "G = 1.62",
    ),
    "what __getattr__ reads": ("G = 9.81", "def __getattr__(self, name): return G", "-self.anything", "G = 1.62"),
    "what an operator reads": (
        "G = 9.81\nclass Planet:\n    def __neg__(self): return -G\nplanet = Planet()",
        "",
        "-planet",
        "G = 1.62",
    ),
    "what a callable object holds": (
        "class Law:\n    g = 9.81\n    def __call__(self): return self.g\nlaw = Law()",
        "",
        "-law()",
        "law.g = 1.62",
    ),
    "what a static method reads": ("G = 9.81", "@staticmethod\ndef g(): return G", "-self.g()", "G = 1.62"),
    "what a class method reads": ("", "G = 9.81\n@classmethod\ndef g(cls): return cls.G", "-self.g()", "Ball.G = 1.62"),
    "a method of the class": ("", "def g(self): return 9.81", "-self.g()", "Ball.g = lambda self: 1.62"),
    "a method of the instance": ("", "def g(self): return 9.81", "-self.g()", "ball.g = lambda: 1.62"),
    "a map of the class": ("", "", "-9.81", "Ball.flow_map = lambda self, s: {'h': s.v, 'v': -1.62}"),
    "a function bound to another object": (
        "class Planet:\n    g = 9.81\n    def fall(self): return self.g\nplanet = Planet()\nfall = planet.fall",
        "",
        "-fall()",
        "planet.g = 1.62",
    ),
    "a partial": (
        "import functools\ndef fall(g): return g\npart = functools.partial(fall, g=9.81)",
        "",
        "-part()",
        "part.keywords['g'] = 1.62",
    ),
    "what a partial calls": (
        "import functools\nG = 9.81\ndef fall(a): return a * G\npart = functools.partial(fall, 1.0)",
        "",
        "-part()",
        "G = 1.62",
    ),
    "what a decorated function reads": (
        """
        import functools
        G = 9.81
        def twice(f):
            @functools.wraps(f)
            def call(): return 2 * f()
            return call
        @twice
        def fall(): return G
        """,
        "",
        "-fall()",
        "G = 1.62",
    ),
    "a builtin method of a list": ("G = [9.81]\nget = G.__getitem__", "", "-get(0)", "G[0] = 1.62"),
    "a view of a dictionary": (
        "import types\nbelow = {'g': 9.81}\nG = types.MappingProxyType(below)",
        "",
        "-G['g']",
        "below['g'] = 1.62",
    ),
    "a rebuilt base": (
        "class Base:\n    g = 9.81\nclass Other:\n    g = 1.62\nclass Planet(Base): pass",
        "",
        "-Planet.g",
        "Planet.__bases__ = (Other,)",
    ),
    "a metaclass": (
        "class Meta(type):\n    g = 9.81\nclass Planet(metaclass=Meta): pass",
        "",
        "-Planet.g",
        "Meta.g = 1.62",
    ),
    "a start value, where a map reads it": (
        "",
        "",
        "-9.81 * float(self.variables[2].start)",
        "ball.variables[2].start[...] = 0.5",
    ),
    "another automaton's parameter": (
        "class Inner(hm.HybridAutomaton):\n    a = hm.Parameter(9.81)\ninner = Inner()",
        "",
        "-float(inner.variables[0].start)",
        "inner = Inner(a=1.62)",
    ),
    "a match on attributes": (
        """
        class Planet:
            __match_args__ = ('g',)
            def __init__(self, g): self.g = g
        planet = Planet(9.81)
        def fall():
            match planet:
                case Planet(g): return g
        """,
        "",
        "-fall()",
        "planet.g = 1.62",
    ),
    "the kind of an object": (
        "class Planet: pass\nplanet = Planet()",
        "",
        "-9.81 if isinstance(planet, Planet) else -1.62",
        "class Planet: pass",
    ),
    "whether two objects are one": ("a = [1.0]\nb = a", "", "-9.81 if a is b else -1.62", "b = [1.0]"),
    "another type of number": ("G = 2", "", "-G // 0.75 * isinstance(G, int)", "G = 2.0"),
    "a constant put into numpy": ("np.G = 9.81", "", "-np.G", "np.G = 1.62"),
    "an array put into numpy": ("np.G = np.array([9.81])", "", "-np.G[0]", "np.G[0] = 1.62"),
    "a function of the framework that is replaced": (
        "first = hm.least",
        "",
        "-hm.least(9.81, 1.62)",
        "hm.least = lambda *margins: 3.0",
    ),
    "a class that is registered with an abstract one": (
        "import abc\nclass Heavy(abc.ABC): pass\nclass Planet: pass\nplanet = Planet()",
        "",
        "-9.81 if isinstance(planet, Heavy) else -1.62",
        "Heavy.register(Planet)",
    ),
    "what a field of a dataclass says": (
        """
        import dataclasses
        def planet(g):
            @dataclasses.dataclass
            class Planet:
                mass: float = dataclasses.field(default=1.0, metadata={"g": g})
            return Planet
        Planet = planet(9.81)
        """,
        "",
        "-dataclasses.fields(Planet)[0].metadata['g']",
        "Planet = planet(1.62)",
    ),
    "the name of a function": (
        "TABLE = {'earth': 9.81, 'moon': 1.62}\ndef fall(): pass\nfall.__name__ = 'earth'",
        "",
        "-TABLE[fall.__name__]",
        "fall.__name__ = 'moon'",
    ),
    "the name of a class": (
        "TABLE = {'Earth': 9.81, 'Moon': 1.62}\nclass Earth: pass",
        "",
        "-TABLE[Earth.__name__]",
        "Earth.__name__ = 'Moon'",
    ),
    "the order of attributes": (
        "class Bag: pass\nbag = Bag()\nbag.a = 9.81\nbag.b = 1.62",
        "",
        "-list(vars(bag).values())[0]",
        "del bag.a\nbag.a = 9.81",
    ),
    "the order of a dictionary": (
        "bag = {'a': 9.81, 'b': 1.62}",
        "",
        "-list(bag.values())[0]",
        "bag['a'] = bag.pop('a')",
    ),
    "what a context manager reads": (
        "import contextlib\nG = 9.81\n@contextlib.contextmanager\ndef planet(): yield G\n"
        "def fall():\n    with planet() as g: return g",
        "",
        "-fall()",
        "G = 1.62",
    ),
    "what a generator function reads": ("G = 9.81\ndef fall(): yield G", "", "-sum(fall())", "G = 1.62"),
    "a global read by a class made in the map": (
        "G = 9.81\ndef fall():\n    class Planet:\n        g = G\n    return Planet.g",
        "",
        "-fall()",
        "G = 1.62",
    ),
    "a map of another automaton": (
        """
        G = 9.81
        class Inner(hm.HybridAutomaton):
            v = hm.State(0.0)
            def flow_map(self, s): return {"v": -G * s.v}
        inner = Inner()
        """,
        "",
        "inner.derivatives(s)['v']",
        "G = 1.62",
    ),
    "the sign of zero": ("G = 0.0", "", "-9.81 * np.copysign(1.0, G)", "G = -0.0"),
}


@pytest.fixture
def restored(monkeypatch):
    """Put back what cases change in modules."""
    monkeypatch.setattr(hm, "least", hm.least)
    monkeypatch.setattr(np, "G", 0.0, raising=False)


@pytest.mark.usefixtures("restored")
@pytest.mark.parametrize("case", NOTICED)
def test_what_changes_a_trace_changes_the_snapshot(case):
    before, body, rate, change = NOTICED[case]
    notebook = Notebook(model(before, body, rate))
    ball = notebook["ball"]
    traced = expressions(ball)
    then = snapshot(ball)
    assert then is not None
    assert then.still_holds()
    notebook.run(change)
    assert expressions(ball) != traced, "the case changes nothing"
    assert not then.still_holds()
    now = snapshot(ball)
    assert now is None or now.key != then.key


UNNOTICED = {
    "another global": ("G = 9.81; H = 1", "", "-G", "H = 2"),
    "a global with the name of a variable": ("v = 1.0", "", "-s.v", "v = 2.0"),
    "an attribute that no map names": ("", "", "-9.81", "ball.note = 'seen'"),
    "a class that is not read": ("class Other:\n    g = 1", "", "-9.81", "Other.g = 2"),
    "the same value": ("G = 9.81", "", "-G", "G = 9.81"),
    "the same content": ("G = [9.81]", "", "-G[0]", "G = [9.81]"),
    "the same helper": ("def fall(): return 9.81", "", "-fall()", "def fall(): return 9.81"),
    "another module's global": ("import math", "", "-math.pi", "math_like = 3"),
    "another instance": ("", "", "-9.81", "other = Ball(e=0.2)"),
    "an attribute of another instance": ("", "g = 9.81", "-self.g", "other = Ball()\nother.g = 1"),
    "a start value": ("", "", "-9.81", "ball.variables[0].start[...] = 5.0"),
}


@pytest.mark.parametrize("case", UNNOTICED)
def test_what_changes_no_trace_leaves_the_key(case):
    before, body, rate, change = UNNOTICED[case]
    notebook = Notebook(model(before, body, rate))
    ball = notebook["ball"]
    traced = expressions(ball)
    then = snapshot(ball)
    notebook.run(change)
    assert expressions(ball) == traced, "the case changes a trace"
    assert snapshot(ball).key == then.key


UNTOLD = {
    "the time of day": ("import time", "", "-time.time()"),
    "random numbers": ("", "", "-np.random.rand()"),
    "random numbers of Python": ("import random", "", "-random.random()"),
    "a generator of random numbers": ("rng = np.random.default_rng(1)", "", "-rng.random()"),
    "random numbers by another name": ("xp = np", "", "-xp.random.rand()"),
    "random numbers imported in the map": ("", "", "-__import__('random').random()"),
    "a file": ("", "", "-float(open('gravity.txt').read())"),
    "a file that numpy reads": ("", "", "-float(np.loadtxt('gravity.txt'))"),
    "globals": ("G = 9.81", "", "-globals()['G']"),
    "eval": ("G = 9.81", "", "-eval('G')"),
    "an iterator": ("values = iter([9.81, 1.62])", "", "-next(values)"),
    "a generator": ("values = (g for g in [9.81, 1.62])", "", "-next(values)"),
    "a remembered result": (
        "import functools\n@functools.lru_cache\ndef fall(): return 9.81",
        "",
        "-fall()",
    ),
    "a function made by numpy": ("fall = np.frompyfunc(lambda a: a, 1, 1)", "", "-fall(9.81)"),
    "a module by its name": ("import importlib", "", "-importlib.import_module('math').pi"),
    "a module out of the list of all": ("import sys", "", "-sys.modules['math'].pi"),
    "the globals of a function": ("G = 9.81\ndef fall(): pass", "", "-fall.__globals__['G']"),
    "annotations": ("class Planet:\n    g: 9.81", "", "-Planet.__annotations__['g']"),
    "a weak reference": ("import weakref\nclass P:\n    g = 1.0\np = P()\nr = weakref.ref(p)", "", "-r().g"),
    "a context variable": ("import contextvars\nG = contextvars.ContextVar('G', default=9.81)", "", "-G.get()"),
    "a computed name in a module": (
        "import types\nconfig = types.ModuleType('config')\nconfig.G = 9.81",
        "",
        "-getattr(config, 'G')",
    ),
    "an object that computes its attributes": (
        "class P:\n    def __getattribute__(self, name): return 1.0\np = P()",
        "",
        "-p.g",
    ),
    "a stand-in for another object": (
        "import weakref\nclass P:\n    g = 1.0\nown = P()\np = weakref.proxy(own)",
        "",
        "-p.g",
    ),
    "a stand-in for an object that is gone": (
        "import weakref\nclass P:\n    g = 1.0\np = weakref.proxy(P())",
        "",
        "-p.g",
    ),
    "an environment variable": ("import os", "", "-float(os.environ['GRAVITY'])"),
}


@pytest.mark.parametrize("case", UNTOLD)
def test_what_cannot_be_told_gives_no_snapshot(case):
    assert snapshot(Notebook(model(*UNTOLD[case]))["ball"]) is None
