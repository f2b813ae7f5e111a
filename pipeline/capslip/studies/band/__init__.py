"""Whether the intervals of the answer hold the truth as often as they say."""
