"""The numbers of a fixed set of analyses, written or compared.

    python tests/same_numbers.py write FOLDER      one JSON file an analysis
    python tests/same_numbers.py compare A B       every value that differs, relative difference

Timings, provenance and paths are left out. Faces: the samples and, where the folder is there, the
real scans and reference faces beside the project.
"""

import json
import math
import sys
from pathlib import Path

MODELS = ("flat", "families", "caps", "mean_field", "interacting", "boundary_elements")
SHARED = Path("../shared")


def cases():
    """Return name -> (path, mate, overrides, config)."""
    samples = sorted(Path("sample_surfaces").glob("*.h5"))
    found = {path.stem: (path, None, (), None) for path in samples}
    a, b = samples[1], samples[2]
    for model in MODELS:
        found[f"{a.stem}-{model}"] = (a, None, (f"contact.model={model}",), None)
    found[f"{a.stem}-peyret2016"] = (a, None, (), "configs/peyret2016.toml")
    for way in ("composite", "together"):
        found[f"mated-{way}"] = (a, b, (f"mating.way={way}",), None)
    for fit in ("equation18", "pinned", "least_squares"):
        found[f"{a.stem}-{fit}"] = (a, None, (f"caps.fit={fit}",), None)
    found[f"{a.stem}-radius"] = (
        a,
        None,
        ("families.feature=radius", "families.count=2", "contact.model=families"),
        None,
    )
    found[f"{a.stem}-bulk"] = (a, None, ("contact.bulk=true",), None)
    found[f"{a.stem}-brass"] = (
        a,
        None,
        ("material.youngs_modulus_Pa=[200e9,100e9]", "material.poisson_ratio=[0.3,0.35]"),
        None,
    )
    for path in sorted((SHARED / "scans").glob("*.*")):
        if path.suffix not in (".md", ".json"):
            found[path.stem] = (path, None, (), None)
            found[f"{path.stem}-2MPa"] = (path, None, ("contact.preload_N=2",), None)
    rubber = SHARED / "scans/conformance/rubber_alicona.x3p"
    if rubber.exists():
        found[rubber.stem] = (rubber, None, (), None)
    for path in sorted((SHARED / "reference").glob("*.h5")):
        found[f"reference-{path.stem}"] = (path, None, (), None)
        found[f"reference-{path.stem}-none"] = (path, None, ("conditioning.form=none",), None)
    return found


def write(folder):
    """Analyse every case and write its numbers."""
    try:
        import capslip
    except ImportError:
        import pipeline as capslip
    folder.mkdir(parents=True, exist_ok=True)
    for name, (path, mate, overrides, config) in cases().items():
        settings = capslip.load_settings(config, overrides)
        other = capslip.load_surface(mate) if mate else None
        try:
            numbers = capslip.analyze(capslip.load_surface(path), settings, other).summary()
            for key in ("timings_s", "provenance"):
                numbers.pop(key, None)
            numbers["surface"].pop("path", None)
            numbers["problems"] = [
                [one[key] for key in ("code", "severity", "message")] for one in numbers["problems"]
            ]
        except capslip.CapslipError as error:
            numbers = {"error": str(error)}
        text = json.dumps(numbers, indent=1, sort_keys=True)
        (folder / f"{name}.json").write_text(text, encoding="utf-8")


def differences(one, other, where=""):
    """Yield a line a value that differs."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in sorted(one.keys() | other.keys()):
            if key not in one or key not in other:
                yield f"{where}.{key}: only in {'first' if key in one else 'second'}"
            else:
                yield from differences(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from differences(a, b, f"{where}[{i}]")
    elif one != other:
        note = ""
        if isinstance(one, float) and isinstance(other, float) and math.isfinite(one) and one:
            note = f" ({other / one - 1:+.1e})"
        yield f"{where}: {one!r} -> {other!r}{note}"


def compare(first, second):
    """Print what differs; return how many analyses do."""
    names = {p.stem for p in first.glob("*.json")} | {p.stem for p in second.glob("*.json")}
    differ = 0
    for name in sorted(names):
        paths = [folder / f"{name}.json" for folder in (first, second)]
        if not all(path.exists() for path in paths):
            lines = [f"missing in {[str(p) for p in paths if not p.exists()]}"]
        else:
            lines = list(differences(*(json.loads(p.read_text(encoding="utf-8")) for p in paths)))
        differ += bool(lines)
        for line in lines[:20]:
            print(f"{name}{line}")
    print(f"{len(names)} analyses, {differ} differ")
    return differ


if __name__ == "__main__":
    if sys.argv[1] == "write":
        write(Path(sys.argv[2]))
    else:
        sys.exit(bool(compare(Path(sys.argv[2]), Path(sys.argv[3]))))
