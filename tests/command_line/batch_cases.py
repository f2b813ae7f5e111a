"""A small scan, and a way to run a batch of them without a child process."""

import threading
from contextlib import contextmanager

import h5py
import numpy as np
import pytest

from capslip import workers


def scan(path, seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:60, :80] * 1.0
    height = -5.0 + np.zeros((60, 80))
    for cx, cy in ((15, 15), (40, 40), (65, 20)):
        height = np.maximum(height, -((x - cx) ** 2 + (y - cy) ** 2) / 50)
    with h5py.File(path, "w") as file:
        file["height"] = height + rng.normal(0, 1e-3, height.shape)
        file["height"].attrs.update(unit="um", pixel_size=[50.0, 50.0], pixel_unit="um")


@contextmanager
def in_this_process():
    """Let a batch make its calls here, one at a time: a child takes longer to start than a scan.

    For tests of what a batch finds and writes; those of children, kills and limits are not for it.
    """
    turn = threading.Lock()

    def call(work, arguments, limits):
        assert limits == workers.NO_LIMITS
        with turn:
            return work(*arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "in_child", call)
        yield
