"""What is chosen by name is one file in a folder of the package: the file's name is its name.

So adding a fit or a rung of the contact ladder touches one file, and settings, command line,
figures and studies learn of it from the folder.
"""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType


def names(folder: str) -> tuple[str, ...]:
    """Return the names in a folder such as `caps.fits`, sorted, without loading what they name."""
    return _names(tuple(import_module(f"capslip.{folder}").__path__))


@cache  # the disk is asked once, an analysis a hundred times
def _names(path: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted(module.name for module in iter_modules(path)))


def entry(folder: str, name: str) -> ModuleType:
    """Return the module of that name in a folder; KeyError where there is none."""
    if name not in names(folder):
        raise KeyError(f"{folder}: no {name!r}; expected one of {', '.join(names(folder))}")
    return import_module(f"capslip.{folder}.{name}")
