"""A ball as a user of pythonfmu3 writes it: the flight in closed form, so that a step does the least work in Python."""

from math import sqrt

from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability


class Ball(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.h, self.v, self.g, self.e = 0.0, 1.0, 0.0, 9.81, 0.7
        continuous = Fmi3Variability.continuous
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(Float64("h", causality=Fmi3Causality.output, variability=continuous))
        self.register_variable(Float64("v", causality=Fmi3Causality.output, variability=continuous))

    def do_step(self, current_time, step_size):
        h, v, g, left = self.h, self.v, self.g, step_size
        while h + v * left - 0.5 * g * left * left < 0.0:
            fall = (v + sqrt(v * v + 2.0 * g * h)) / g
            h, v, left = 0.0, -self.e * (v - g * fall), left - fall
        self.h, self.v = h + v * left - 0.5 * g * left * left, v - g * left
        self.time = current_time + step_size
        return True
