"""Whether the answer owes anything to the plane taken off, the cut, or where the map begins."""
