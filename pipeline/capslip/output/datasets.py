"""Arrays in an HDF5 file, each with its unit."""

from typing import Any

import numpy as np


def write_dataset(group: Any, name: str, values: np.ndarray, unit: str, **options: Any) -> Any:
    """Write an array with the attribute `unit`, and return its dataset.

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
    import h5py
    from h5py import h5a, h5d, h5s, h5t

    word = h5py.string_dtype()
    if options or values.dtype.kind in "UO":
        values = values.astype(word) if values.dtype.kind == "U" else values
        dataset = group.create_dataset(name, data=values, **options)
    else:
        kind, space = h5t.py_create(values.dtype, logical=True), h5s.create_simple(values.shape)
        held = h5d.create(group.id, name.encode(), kind, space)
        held.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values))
        dataset = h5py.Dataset(held)
    kind = h5t.py_create(word, logical=True)
    h5a.create(dataset.id, b"unit", kind, h5s.create(h5s.SCALAR)).write(np.array(unit, dtype=word))
    return dataset
