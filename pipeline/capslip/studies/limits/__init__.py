"""Where the method breaks, and what the program says there."""
