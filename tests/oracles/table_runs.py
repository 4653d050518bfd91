"""Exact runs of scenarios whose weights are straight lines between known times, under a constant threshold.

Between two broadcasts and two of those times every error is a parabola in time, so the next event is a root of two
quadratic equations. Weights and graphs are looked up here once more, from the scenario's data.
"""

import math
from bisect import bisect_right

import numpy as np

from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.piecewise import PiecewiseWeight
from hybrid_model.consensus.weights.sampled import SampledWeight
from hybrid_model.consensus.weights.square import SquareWeight


def table_run(scenario):
    """Event times of each agent and the states at the stop time."""
    network, c = scenario.network, scenario.trigger.threshold
    tails, heads = (np.array(network.edges) - 1).T
    x = np.array(network.initial, dtype=float)
    held = x.copy()
    events = [[] for _ in x]
    for start, end in pieces(scenario):
        middle = (start + end) / 2
        on = np.array([e + 1 in active(scenario.switching, middle) for e in range(len(tails))])
        lines = np.array([line(wave, middle) for wave in scenario.weights.waveforms]) * on[:, None]
        t = start
        while True:
            level = lines[:, 0] + lines[:, 1] * (t - middle)
            flow = held[tails] - held[heads]
            speed, bend = (network.gain * sums(flow * w, tails, heads, len(x)) for w in (level, lines[:, 1]))
            # The error is e + speed*s + bend*s^2/2 after s seconds.
            e = held - x
            roots = [first_root(e[i], speed[i], bend[i], c) for i in range(len(x))]
            s = min(roots)
            if t + s >= end:
                x = x - speed * (end - t) - bend * (end - t) ** 2 / 2
                break
            x, t = x - speed * s - bend * s**2 / 2, t + s
            for i in range(len(x)):
                if roots[i] <= s + 1e-12:
                    events[i].append(t)
                    held[i] = x[i]
    return events, x


def sums(per_edge, tails, heads, count):
    total = np.zeros(count)
    np.add.at(total, tails, per_edge)
    np.add.at(total, heads, -per_edge)
    return total


def first_root(e, speed, bend, c):
    """First s > 0 at which ``|e + speed*s + bend*s^2/2|`` rises to c."""
    found = [math.inf]
    for sign in (1.0, -1.0):
        a, b, d = sign * bend / 2, sign * speed, sign * e - c
        if d >= 0:  # at the threshold up to rounding: it counts if the error grows
            found += [0.0] if b > 0 or (b == 0 and a > 0) else []
        elif a == 0:
            found += [-d / b] if b > 0 else []
        elif b * b - 4 * a * d >= 0:
            root = math.sqrt(b * b - 4 * a * d)
            found += [-2 * d / rise for rise in (b + root, b - root) if rise > 0]
    return min(found)


def pieces(scenario):
    end = scenario.stop_time
    cuts = set()
    for wave in scenario.weights.waveforms:
        cuts |= set(times_of(wave, end))
    cuts |= set(instants(scenario.switching, end))
    times = [0.0]
    for t in sorted(cuts):
        if t > times[-1] + 1e-12 and t < end - 1e-12:
            times.append(t)
    return list(zip(times, [*times[1:], end], strict=True))


def times_of(wave, end):
    if isinstance(wave, PiecewiseWeight | SampledWeight):
        table = wave.starts if isinstance(wave, PiecewiseWeight) else wave.times
        cycle = wave.cycle if isinstance(wave, PiecewiseWeight) else (table[-1] - table[0] if wave.repeat else None)
        return repeated(table, cycle, end)
    if isinstance(wave, SquareWeight):
        period = 2 * math.pi / wave.gate_rate
        opens = wave.phase / wave.gate_rate
        return repeated((opens, opens + period * wave.duty_percent / 100), period, end)
    return []


def repeated(table, cycle, end):
    if cycle is None:
        return list(table)
    first = math.floor(-table[-1] / cycle)
    return [t + k * cycle for k in range(first, math.ceil((end - table[0]) / cycle) + 1) for t in table]


def line(wave, t):
    """Value and slope at a time inside a piece."""
    if isinstance(wave, ConstantWeight):
        return wave.level, 0.0
    if isinstance(wave, SquareWeight):
        share = ((wave.gate_rate * t - wave.phase) / (2 * math.pi)) % 1.0
        return (wave.high if share < wave.duty_percent / 100 else wave.low), 0.0
    if isinstance(wave, PiecewiseWeight):
        local = t if wave.cycle is None else wave.starts[0] + (t - wave.starts[0]) % wave.cycle
        return wave.values[max(bisect_right(wave.starts, local) - 1, 0)], 0.0
    span = wave.times[-1] - wave.times[0]
    local = wave.times[0] + (t - wave.times[0]) % span if wave.repeat else t
    k = min(max(bisect_right(wave.times, local) - 1, 0), len(wave.times) - 2)
    slope = (wave.values[k + 1] - wave.values[k]) / (wave.times[k + 1] - wave.times[k])
    return wave.values[k] + slope * (local - wave.times[k]), slope


def active(switching, t):
    if isinstance(switching, NoSwitching):
        return range(1, switching.edge_count + 1)
    if isinstance(switching, SwitchingCycle):
        return switching.active[int(t // switching.dwell) % len(switching.active)]
    total = sum(switching.dwells)
    local = t % total if switching.repeat else t
    for dwell, edges in zip(switching.dwells, switching.active, strict=True):
        local -= dwell
        if local < 0:
            return edges
    return switching.active[-1]


def instants(switching, end):
    if isinstance(switching, NoSwitching):
        return []
    dwells = [switching.dwell] if isinstance(switching, SwitchingCycle) else switching.dwells
    repeat = isinstance(switching, SwitchingCycle) or switching.repeat
    return repeated(tuple(np.concatenate(([0.0], np.cumsum(dwells)))), sum(dwells) if repeat else None, end)
