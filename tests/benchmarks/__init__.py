"""Event-exact runs by several tools on problems with exact event times; ``make benchmark`` prints the tables."""
