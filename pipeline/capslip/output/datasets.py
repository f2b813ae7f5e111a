"""Arrays in an HDF5 file, each with its unit."""

from functools import cache
from typing import Any

import numpy as np


def write_dataset(group: Any, name: str, values: np.ndarray, unit: str, **options: Any) -> Any:
    """Write an array with the attribute `unit`, and return the h5py.h5d.DatasetID of its dataset.

    Parameters
    ----------
    group : h5py.Group
        In which there is nothing of that name.
    name : str
        Without slashes.
    values : ndarray
        Numbers, flags or words.
    unit : str
        What one of them is.
    **options
        Of `create_dataset`. Without any, the functions below h5py's objects write the same in a
        third of the time: a result has some forty small arrays.
    """
    from h5py import h5a, h5d, h5s

    word, text, scalar = _types()
    if values.dtype.kind in "UO":
        values = values.astype(word)
    if options:
        held = group.create_dataset(name, data=values, **options).id
    else:
        kind = text if values.dtype == word else _as_stored(values.dtype)
        held = h5d.create(group.id, name.encode(), kind, h5s.create_simple(values.shape))
        held.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values))
    h5a.create(held, b"unit", text, scalar).write(np.array(unit, dtype=word))
    return held


@cache
def _as_stored(dtype: np.dtype) -> Any:
    """Return a type of numbers as HDF5 has it."""
    from h5py import h5t

    return h5t.py_create(dtype, logical=True)


@cache
def _types() -> tuple[np.dtype, Any, Any]:
    """Return the type of words, the same as HDF5 has it, and the space of one."""
    import h5py
    from h5py import h5s, h5t

    word = h5py.string_dtype()
    return word, h5t.py_create(word, logical=True), h5s.create(h5s.SCALAR)
