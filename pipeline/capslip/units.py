"""The units of length that a file or a user can name: the one table of them."""

from typing import TYPE_CHECKING, Literal

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12, "inch": 0.0254}
SPELLINGS = {
    "µm": "um",  # micro sign
    "μm": "um",  # Greek mu
    "micron": "um",
    "in": "inch",
    "metre": "m",
    "meter": "m",
    "millimetre": "mm",
    "millimeter": "mm",
    "micrometre": "um",
    "micrometer": "um",
    "nanometre": "nm",
    "nanometer": "nm",
}
WORDS = (*METRES, "µm")  # of options and settings

if TYPE_CHECKING:
    LengthUnit = str
else:
    LengthUnit = Literal[WORDS]
