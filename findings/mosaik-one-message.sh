#!/usr/bin/env bash
# mosaik delivers one of two messages that an entity sends for one time, and drops the other.
#
# An event-based simulator of mosaik gives its outputs a time at which they hold, which may lie ahead: so a network with
# delays is written. A good engineer expects that each message arrives. The inputs of a step have one place for each
# entity that sends, so of two messages that one entity sends in two steps for the same later time the receiver sees the
# second, and cannot know that there was another. With delays that are 1 s longer or shorter, or with messages from two
# entities, all arrive. A comment inside the code of mosaik knows of it; a run says nothing. Who is hurt: co-simulation
# with communication networks: packets with different delays are lost where they meet, and counters, sums of increments
# or pairs of opposite commands come out wrong, the more so the coarser the resolution of time is.
#
# Needs python3 with venv. Ends with status 0 if mosaik still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'mosaik==3.6.0' 'mosaik-api-v3==3.0.16'

cat > "$work/run.py" <<'P'
import sys
from importlib.metadata import version

import mosaik
import mosaik_api_v3


def meta():
    model = {"public": True, "params": [], "attrs": ["message"]}
    return {"api_version": "3.0", "type": "event-based", "models": {"Model": model}}


class Network(mosaik_api_v3.Simulator):
    """Sends messages: (time of sending in s, delay in s, number of the line, content)."""

    def __init__(self):
        super().__init__(meta())

    def init(self, sid, time_resolution, messages):
        self.messages = messages
        return self.meta

    def create(self, number, model):
        return [{"eid": f"line {k}", "type": model} for k in range(number)]

    def step(self, time, inputs, max_advance):
        self.time = time
        return min((sent for sent, *_ in self.messages if sent > time), default=None)

    def get_data(self, outputs):
        for sent, delay, line, content in self.messages:
            if sent == self.time:
                return {"time": sent + delay, f"line {line}": {"message": content}}
        return {}


class Receiver(mosaik_api_v3.Simulator):
    def __init__(self):
        super().__init__(meta())

    def init(self, sid, time_resolution, inbox):
        self.inbox = inbox
        return self.meta

    def create(self, number, model):
        return [{"eid": "receiver", "type": model}]

    def step(self, time, inputs, max_advance):
        self.inbox.extend((time, content) for content in sorted(inputs["receiver"]["message"].values()))
        return None

    def get_data(self, outputs):
        return {}


def arrived(messages):
    """(time in s, content) of what the receiver is given until 10 s."""
    inbox = []
    known = {"Network": {"python": "__main__:Network"}, "Receiver": {"python": "__main__:Receiver"}}
    with mosaik.World(known, time_resolution=1.0) as world:
        network = world.start("Network", sim_id="network", messages=messages)
        receiver = world.start("Receiver", sim_id="receiver", inbox=inbox).Model()
        for line in network.Model.create(2):
            world.connect(line, receiver, "message")
        world.set_initial_event("network")
        world.run(until=10, print_progress=False)
    return inbox


cases = {
    "two meet at 5 s": [(0, 5, 0, "open"), (2, 3, 0, "shut")],
    "three meet at 5 s": [(0, 5, 0, "open"), (2, 3, 0, "shut"), (5, 0, 0, "open again")],
    "two come 1 s apart": [(0, 5, 0, "open"), (2, 4, 0, "shut")],
    "two meet, from two entities": [(0, 5, 0, "open"), (2, 3, 1, "shut")],
}
print(f"mosaik {version('mosaik')}: messages (sent at s, delay in s, entity, content); what the receiver is given")
found = {}
for name, messages in cases.items():
    found[name] = arrived(messages)
    print(f"  {name}: {messages}; given: {found[name]}", flush=True)
expected = [
    [(5, "shut")],
    [(5, "open again")],
    [(5, "open"), (6, "shut")],
    [(5, "open"), (5, "shut")],
]
sys.exit(list(found.values()) != expected)
P
"$work/env/bin/python" "$work/run.py" 2> "$work/log" || { cat "$work/log"; exit 1; }
