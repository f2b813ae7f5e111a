"""Synthetic faces of known content: their generator, the scenes of the studies, the samples."""
