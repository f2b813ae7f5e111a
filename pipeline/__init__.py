"""capslip: from a scan of a joint face to its damping.

The public names load on first use, so that `import pipeline` and `capslip --help` stay fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from pipeline.analysis import Analysis, analyze
    from pipeline.errors import CapslipError
    from pipeline.settings import Settings, load_settings
    from pipeline.surface.heightmap import HeightMap
    from pipeline.surface.readers import load_surface

__all__ = [
    "Analysis",
    "CapslipError",
    "HeightMap",
    "Settings",
    "analyze",
    "load_settings",
    "load_surface",
]

_HOME = {
    "Analysis": "pipeline.analysis",
    "CapslipError": "pipeline.errors",
    "HeightMap": "pipeline.surface.heightmap",
    "Settings": "pipeline.settings",
    "analyze": "pipeline.analysis",
    "load_settings": "pipeline.settings",
    "load_surface": "pipeline.surface.readers",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
