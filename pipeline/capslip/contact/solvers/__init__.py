"""Solvers of the contact models."""
