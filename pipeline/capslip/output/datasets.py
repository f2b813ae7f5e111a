"""Arrays in an HDF5 file, each with its unit."""

from functools import cache
from typing import Any

import numpy as np


def write_dataset(group: Any, name: str, values: np.ndarray, unit: str, **options: Any) -> Any:
    """Write an array with the attribute `unit`, and return the h5py.h5d.DatasetID of its dataset.

    Parameters
    ----------
    group : h5py.h5g.GroupID
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
    from h5py import h5d, h5s

    if values.dtype.kind in "UO":
        values = values.astype(_word())
    if options:
        held = h5py.Group(group).create_dataset(name, data=values, **options).id
    else:
        stored, in_memory = _types(values.dtype)
        held = h5d.create(group, name.encode(), stored, h5s.create_simple(values.shape))
        held.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values), in_memory)
    write_attribute(held, "unit", unit)
    return held


def write_attribute(held: Any, name: str, value: str | float | tuple[float, ...]) -> None:
    """Write a word, a number or some beside the h5py.h5d.DatasetID of a dataset."""
    from h5py import h5a, h5s

    values = np.array(value, dtype=_word() if isinstance(value, str) else float)
    stored, in_memory = _types(values.dtype)
    space = h5s.create_simple(values.shape) if values.ndim else h5s.create(h5s.SCALAR)
    h5a.create(held, name.encode(), stored, space).write(values, in_memory)


@cache
def _types(dtype: np.dtype) -> tuple[Any, Any]:
    """Return a type as HDF5 stores it and as numpy holds it, which takes a while to tell."""
    from h5py import h5t

    return h5t.py_create(dtype, logical=True), h5t.py_create(dtype)


@cache
def _word() -> np.dtype:
    """Return the type of words."""
    import h5py

    return h5py.string_dtype()
