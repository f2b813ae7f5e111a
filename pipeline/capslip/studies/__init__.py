"""Studies of the method itself: the paper, timings, accuracy and limits."""
