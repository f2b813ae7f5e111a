"""From slip in the joints to the damping of the structure."""
