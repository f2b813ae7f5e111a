"""The ways to fit a sphere to a hill: one file each, whose name is its name in `caps.fit`.

A file holds one object, `FIT`, of `capslip.caps.fitting.Fit`. Nothing else knows the names.
"""
