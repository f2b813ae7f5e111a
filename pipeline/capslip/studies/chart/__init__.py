"""Speed against accuracy of every method."""
