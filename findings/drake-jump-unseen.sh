#!/usr/bin/env bash
# Drake does not see that a witness function changes its sign if the change comes from a discrete update.
#
# A tank that fills slowly and gets a batch of 1 m3 every hour, with a witness function for the level of 2 m3: its event
# is to open a drain. The direction is kCrossesZero, described as triggering any time that the function crosses zero.
# A good engineer expects the drain to open when a batch lifts the level from 1.4 to 2.4 m3. It stays shut, at that
# instant and for ever: the function is compared between the beginning and the end of a step of the integrator, after the
# update of its first instant, so that what the update did lies between two steps and in neither. Poured in at a rate,
# the same volume opens the drain. Who is hurt: everybody whose guards and sampled controllers, resets or impacts meet,
# for one event that causes another is lost in silence. The documents name the two times that are compared, but not on
# which side of an update the first one lies.
#
# Needs python3 with venv. Ends with status 0 if Drake still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'drake==1.51.1'

"$work/env/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import LeafSystem, UnrestrictedUpdateEvent, WitnessFunctionDirection

LIMIT = 2.0


class Tank(LeafSystem):
    """A level that grows by a rate and, if there are batches, by a jump each hour; it notes when its drain opens."""

    def __init__(self, rate, batch):
        super().__init__()
        self.rate = rate
        self.opened = []
        self.DeclareContinuousState(1)
        if batch:
            self.batch = batch
            self.DeclarePeriodicUnrestrictedUpdateEvent(1.0, 1.0, self.pour)
        self.limit = self.MakeWitnessFunction(
            "limit",
            WitnessFunctionDirection.kCrossesZero,
            lambda context: LIMIT - level(context),
            UnrestrictedUpdateEvent(self.open),
        )

    def DoCalcTimeDerivatives(self, context, derivatives):
        derivatives.get_mutable_vector().SetFromVector([self.rate])

    def DoGetWitnessFunctions(self, context):
        return [self.limit]

    def pour(self, context, state):
        state.get_mutable_continuous_state().get_mutable_vector().SetFromVector([level(context) + self.batch])

    def open(self, context, event, state):
        self.opened.append(round(context.get_time(), 3))


def level(context):
    return context.get_continuous_state_vector()[0]


def run(rate, batch):
    tank = Tank(rate, batch)
    simulator = Simulator(tank)
    simulator.get_mutable_context().SetAccuracy(1e-6)
    simulator.Initialize()
    simulator.AdvanceTo(4.5)
    end = round(level(simulator.get_context()), 6)
    print(f"  {rate} m3/h and batches of {batch} m3: level {end} m3 in the end, drain opened at {tank.opened}")
    return end, tank.opened


print(f"drake {version('drake')}: a drain that is to open at {LIMIT} m3")
in_batches = run(0.2, 1.0)
at_a_rate = run(1.2, 0.0)
sys.exit(not (in_batches[0] > LIMIT and in_batches[1] == [] and at_a_rate[0] > LIMIT and len(at_a_rate[1]) == 1))
PYTHON
