"""Reading and conditioning of height maps."""
