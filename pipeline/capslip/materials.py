"""Materials by name: what a preset says of a body, and where it is written.

The yield stresses are the least that the standard asks of a grade, so a face of that grade is at
least as hard. Machining hardens its skin: a hardness measured on the face itself is better.
"""

from dataclasses import dataclass
from typing import Any

from capslip.errors import SettingsError, one_of


@dataclass(frozen=True)
class Material:
    """One engineering metal."""

    label: str  # the grade that stands for all
    youngs_modulus_Pa: float
    poisson_ratio: float
    yield_stress_Pa: float  # 0.2 % proof stress of that grade (0.1 % in compression for cast iron)
    softest_yield_stress_Pa: float  # of the softest grade of the kind
    source: str


MATERIALS = {
    "steel": Material(
        *("structural steel S355", 210e9, 0.3, 355e6, 235e6),
        "EN 1993-1-1:2005, 3.2.6; EN 10025-2:2019, S355 and S235 up to 16 mm",
    ),
    "quenched_steel": Material(
        *("quenched and tempered steel 42CrMo4", 210e9, 0.3, 650e6, 500e6),
        "EN 10083-3:2006, 42CrMo4 +QT at 40 to 100 mm and at 160 to 250 mm",
    ),
    "stainless": Material(
        *("austenitic stainless steel 1.4301", 200e9, 0.3, 210e6, 200e6),
        "EN 1993-1-4:2006, 2.1.3; EN 10088-2:2014, hot-rolled plate of 1.4301 and 1.4307",
    ),
    "aluminium": Material(
        *("aluminium alloy 6082-T6", 70e9, 0.3, 250e6, 35e6),
        "EN 1999-1-1:2007, 3.2.5; tables 3.2a and b, EN AW-6082-T6 up to 5 mm and 5005-O",
    ),
    "titanium": Material(
        *("titanium alloy Ti-6Al-4V", 114e9, 0.34, 828e6, 138e6),
        "ASTM B265, grades 5 and 1; elastic constants: Boyer, Welsch, Collings 1994, "
        "Materials Properties Handbook: Titanium Alloys",
    ),
    "brass": Material(
        *("free-cutting brass C36000, half hard", 97e9, 0.31, 310e6, 124e6),
        "Copper Development Association, UNS C36000, rod H02 of 25 mm and annealed O61",
    ),
    "cast_iron": Material(
        *("grey cast iron EN-GJL-250", 110e9, 0.26, 325e6, 195e6),
        "EN 1561:1997, Annex A, EN-GJL-250 and -150",
    ),
}

SAID = ("youngs_modulus_Pa", "poisson_ratio", "yield_stress_Pa", "hardness_Pa")  # of a material


def with_preset(tables: dict[str, Any], where: str = "settings") -> dict[str, Any]:
    """Fill in what the materials named in nested dictionaries say and the dictionaries do not.

    What they say is marked as theirs, by `material.values_of`: where another material is named
    later, it gives way.

    Raises
    ------
    SettingsError
        A name that is none of MATERIALS, or not one or two of them; or numbers that may be of the
        material before.
    """
    given = tables.get("material", {})
    preset = given.get("preset") if isinstance(given, dict) else None
    if preset is None:
        return tables
    known = _said(_named(preset, "preset", where))
    given = _without_others(given, preset, where)
    if "hardness_Pa" in given:
        del known["yield_stress_Pa"]
    return {**tables, "material": {**known, **given, "values_of": preset}}


def _named(preset: Any, key: str, where: str) -> list[str]:
    """Return the name of the material of each face."""
    names = [preset, preset] if isinstance(preset, str) else preset
    two = "one for each face: [steel, aluminium]"
    if not isinstance(names, list | tuple) or len(names) != 2:
        raise SettingsError(f"{where}: material.{key}: got {preset!r}; expected one, or {two}")
    for name in map(str, names):
        if name not in MATERIALS:
            what = f"got {name!r}; {one_of(MATERIALS, name)}; or {two}"
            raise SettingsError(f"{where}: material.{key}: {what}")
    return list(names)


def _said(names: list[str]) -> dict[str, Any]:
    """Return what the materials of two faces say."""
    bodies = [MATERIALS[name] for name in names]
    return {
        "youngs_modulus_Pa": [body.youngs_modulus_Pa for body in bodies],
        "poisson_ratio": [body.poisson_ratio for body in bodies],
        "yield_stress_Pa": min(body.yield_stress_Pa for body in bodies),
    }


def _without_others(given: dict[str, Any], preset: Any, where: str) -> dict[str, Any]:
    """Leave out what another material said, that stood here before; refuse what may be of it."""
    before = given.get("values_of")
    if before is None or before == preset:
        return given
    said = _said(_named(before, "values_of", where))
    kept = {key: of for key, of in given.items() if key not in SAID or of != said.get(key)}
    if unclear := [f"material.{key}" for key in SAID if key in kept]:
        raise SettingsError(
            f"{where}: material.preset: got {preset!r} in place of {before!r}, and "
            f"{', '.join(unclear)}, which may be of either; expected a material of its own, such "
            f"as Material(preset={preset!r}, ...), or a file without material.values_of"
        )
    return kept


def without_said(tables: dict[str, Any]) -> dict[str, Any]:
    """Leave out of nested dictionaries what a material says, where another one is named instead."""
    given = tables.get("material")
    if not isinstance(given, dict):
        return tables
    stale = (*SAID, "values_of")
    return {**tables, "material": {key: of for key, of in given.items() if key not in stale}}


def refuse_stray_spread(tables: dict[str, Any], where: str) -> None:
    """Refuse the spread of a hardness that nested dictionaries, filled in, do not have.

    Raises
    ------
    SettingsError
        If there is one.
    """
    given = tables.get("material", {})
    spread = given.get("hardness_spread", 0.0)
    if spread > 0.0 and "hardness_Pa" not in given and "yield_stress_Pa" not in given:
        raise SettingsError(
            f"{where}: material.hardness_spread: got {spread:g} without a hardness, so nothing "
            "yields; expected material.hardness_Pa, material.yield_stress_Pa or material.preset "
            "with it"
        )
