"""From a height map to fitted caps and their families."""
