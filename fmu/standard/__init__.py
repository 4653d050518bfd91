"""Facts of FMI 2.0 and 3.0 that several rooms need: functions, capabilities, types of values, units,
names of platforms.

It imports the standard library only; what the versions say alike stands once, what differs in one table.
"""
