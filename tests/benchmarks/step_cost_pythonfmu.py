"""A ball as a user of pythonfmu writes it: the flight in closed form, so that a step does the least work in Python."""

from math import sqrt

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Ball(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.h, self.v, self.g, self.e = 1.0, 0.0, 9.81, 0.7
        self.register_variable(Real("h", causality=Fmi2Causality.output))
        self.register_variable(Real("v", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        h, v, g, left = self.h, self.v, self.g, step_size
        while h + v * left - 0.5 * g * left * left < 0.0:
            fall = (v + sqrt(v * v + 2.0 * g * h)) / g
            h, v, left = 0.0, -self.e * (v - g * fall), left - fall
        self.h, self.v = h + v * left - 0.5 * g * left * left, v - g * left
        return True
