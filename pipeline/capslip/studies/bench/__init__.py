"""Timings of commands, stages and solvers beside their peers."""
