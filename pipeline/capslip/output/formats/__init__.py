"""Formats that the face of a result is written in; see `output/convert.py`."""
