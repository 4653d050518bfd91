"""The nine textbook models as loops over `solve_ivp`, as a user who knows it writes them: by hand for each model.

An event is terminal and has its direction; a flow and its events are made once, not at each restart.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp


def _event(margin, direction=1):
    def event(t, x):
        return margin(x)

    event.terminal, event.direction = True, direction
    return event


def _restarts(t_end, x, modes, jump, options, mode=0):
    """Run ``modes[mode] = (flow, events)`` from event to event.

    ``jump(mode, which, x)`` returns the names of the jumps at that instant, the next mode and the state.
    """
    t, seen = 0.0, []
    while t < t_end:
        flow, events = modes[mode]
        solution = solve_ivp(flow, (t, t_end), x, events=events, **options)
        t, x = float(solution.t[-1]), solution.y[:, -1]
        if solution.status == 1:
            which = next(k for k, times in enumerate(solution.t_events) if times.size)
            names, mode, x = jump(mode, which, x)
            seen += [(name, t) for name in names]
    return seen, x


def drag_ball(t_end, options):
    def flow(t, x):
        return [x[1], -9.81 - 0.05 * x[1] * abs(x[1])]

    floor = _event(lambda x: x[0], -1)
    return _restarts(t_end, [1.0, 0.0], [(flow, floor)], lambda m, k, x: (["jump"], 0, [0.0, -0.85 * x[1]]), options)


def neurons(t_end, options):
    def flow(t, x):
        return [1.3 - x[0], 1.25 - x[1]]

    def fire(mode, which, x):
        x = x + 0.04
        x[which] = 0.0
        names = ["a_fires", "b_fires"]
        if x[1 - which] < 1.0:
            return [names[which]], 0, x
        x[1 - which], x[which] = 0.0, 0.04
        return [names[which], names[1 - which]], 0, x

    events = [_event(lambda x: x[0] - 1.0), _event(lambda x: x[1] - 1.0)]
    return _restarts(t_end, [0.0, 0.35], [(flow, events)], fire, options)


def buck(t_end, options):
    def flow(on):
        return lambda t, x: [(on * 12.0 - x[1]) / 0.1, (x[0] - x[1] / 2.5) / 0.2]

    modes = [(flow(0), _event(lambda x: 1.8 - x[0])), (flow(1), _event(lambda x: x[0] - 2.2))]
    return _restarts(t_end, [0.0, 0.0], modes, lambda on, k, x: ([("on", "off")[on]], 1 - on, x), options, mode=1)


def stick_slip(t_end, options):
    def sticking(t, x):
        return [0.5, 0.0]

    def slipping(t, x):
        return [x[1], 1.0 - x[0]]

    modes = [(sticking, _event(lambda x: x[0] - 1.5)), (slipping, _event(lambda x: x[1] - 0.5))]
    names = ("slips", "sticks")
    return _restarts(t_end, [0.0, 0.5], modes, lambda m, k, x: ([names[m]], 1 - m, [x[0], 0.5]), options)


def pendulum_at_wall(t_end, options):
    def flow(t, x):
        return [x[1], -math.sin(x[0])]

    wall = _event(lambda x: x[0] + 0.3, -1)
    return _restarts(t_end, [1.2, 0.0], [(flow, wall)], lambda m, k, x: (["jump"], 0, [-0.3, -0.95 * x[1]]), options)


def circle_billiard(t_end, options):
    def flow(t, x):
        return [x[2], x[3], 0.0, 0.0]

    def reflect(mode, which, x):
        normal = x[:2] / math.sqrt(x[0] ** 2 + x[1] ** 2)
        return ["jump"], 0, np.concatenate([normal, x[2:] - 2.0 * (x[2:] @ normal) * normal])

    circle = _event(lambda x: x[0] ** 2 + x[1] ** 2 - 1.0)
    return _restarts(t_end, [0.3, 0.0, 0.6, 0.8], [(flow, circle)], reflect, options)


def rimless_wheel(t_end, options):
    def flow(t, x):
        return [x[1], math.sin(x[0])]

    spoke, loss = _event(lambda x: x[0] - 0.38), math.cos(0.6)
    return _restarts(t_end, [-0.2, 0.6], [(flow, spoke)], lambda m, k, x: (["jump"], 0, [-0.22, loss * x[1]]), options)


def reset_loop(t_end, options):
    def flow(t, x):
        error = 1.0 - x[0]
        return [x[1], -x[1] + 2.0 * x[2] + error, error]

    modes = [(flow, _event(lambda x: x[0] - 1.0, 1)), (flow, _event(lambda x: x[0] - 1.0, -1))]
    return _restarts(t_end, [0.0, 0.0, 0.0], modes, lambda up, k, x: (["empty"], 1 - up, [x[0], x[1], 0.0]), options)


def sampled_pd(t_end, options):
    """Times are known: no event functions."""
    x, seen, k = np.array([1.0, 0.0]), [], 0
    while k * 0.1 <= t_end:
        u = -4.0 * x[0] - 2.0 * x[1]
        seen.append(("sample", k * 0.1))
        span = (k * 0.1, min((k + 1) * 0.1, t_end))
        x = solve_ivp(lambda t, x, u=u: [x[1], u], span, x, **options).y[:, -1]
        k += 1
    return seen, x
