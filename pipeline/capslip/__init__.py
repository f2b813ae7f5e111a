"""capslip: from a scan of a joint face to its damping.

The public names load on first use, so that `import capslip` and `capslip --help` stay fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from capslip.analysis import analyze
    from capslip.errors import CapslipError
    from capslip.output.arrays import Tables
    from capslip.output.folder import write
    from capslip.output.plots import Plots
    from capslip.result import Analysis
    from capslip.settings import Settings, load_settings
    from capslip.surface.heightmap import HeightMap
    from capslip.surface.readers import load_surface

__all__ = [
    "Analysis",
    "CapslipError",
    "HeightMap",
    "Plots",
    "Settings",
    "Tables",
    "analyze",
    "load_settings",
    "load_surface",
    "write",
]

_HOME = {
    "Analysis": "capslip.result",
    "CapslipError": "capslip.errors",
    "HeightMap": "capslip.surface.heightmap",
    "Plots": "capslip.output.plots",
    "Settings": "capslip.settings",
    "Tables": "capslip.output.arrays",
    "analyze": "capslip.analysis",
    "load_settings": "capslip.settings",
    "load_surface": "capslip.surface.readers",
    "write": "capslip.output.folder",
}


if not TYPE_CHECKING:  # else every misspelt name would be one

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
