"""The numerics below the contact models."""
