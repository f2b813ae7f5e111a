"""The commands that stand in a text, not in a `{run}` block, run once each while the site is made.

`face.x3p` and the like stand for files of the reader. Here they are small faces and a sample, in
`build/runs/shown`, without pictures. A command that ends with an error is a warning, which ends
the build. What is only named (`capslip batch`), needs a cluster or takes minutes is left out. What
passed is kept until a command, this file or the package changes.
"""

import hashlib
import re
import shutil
from pathlib import Path

from capslip.provenance import code_sha256

PROJECT = Path(__file__).resolve().parents[2]
RUNS = PROJECT / "build" / "runs"
FOLDER, PASSED = RUNS / "shown", RUNS / "shown.passed"
PAGES = sorted([*(PROJECT / "docs").glob("*.md"), *(PROJECT / "docs").glob("guides/*.md")])
PAGES += [PROJECT / "README.md", PROJECT / "CONTRIBUTING.md"]
FENCED = re.compile(r"^```\{run\}\n((?::.*\n)*)(.*?)^```$", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^(?:    |\t)(capslip (?:[^\n]*\\\n)*[^\n]*)$", re.MULTILINE)
INLINE = re.compile(r"`(capslip [a-z][^`\n]*)`")
MINUTES = ("bench", "chart", "limits", "reproduce")
CLUSTER = "--scheduler"
ALONE = {"formats"}  # commands that need no argument; another one alone is a name
STANDS_FOR = """
import h5py, numpy as np, x3pio

import capslip
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface

families = CapFamily("G", 3, 24.0), CapFamily("P", 4, 24.0, 1e-7)
seeds = {"face": 4, "face_a": 5, "face_b": 6, "a": 4, "b": 5, "c": 6, "one": 6, "two": 7}
for name, seed in seeds.items():
    name = f"scans/{name}" if name in ("one", "two") else name
    scene = Scene((100, 75), (4e-4, 4e-4), seed=seed, families=families, noise_rms_m=1e-9)
    height_m = synthetic_surface(scene)[0].height_m
    x3pio.write(f"{name}.x3p", height_m, x_scale=4e-4, y_scale=4e-4)
    if name in ("a", "b"):
        with h5py.File(f"{name}.h5", "w") as file:
            file["height"] = height_m
            file["height"].attrs.update(unit="m", pixel_size=[0.4, 0.4], pixel_unit="mm")
for name in ("first", "second"):  # scans of one place
    noise_m = 1e-9 * np.random.default_rng(len(name)).standard_normal(height_m.shape)
    x3pio.write(f"{name}.x3p", height_m + noise_m, x_scale=4e-4, y_scale=4e-4)
y, x = np.indices(height_m.shape)
points = (400.0 * x, 400.0 * y, 1e6 * height_m)
np.savetxt("face.xyz", np.transpose([one.ravel() for one in points]), "%.6g")
fine = capslip.load_surface("sample_surfaces/paper_face_a.h5")
np.save("heights.npy", 1e6 * fine.height_m)
np.savetxt("face.csv", 1e6 * fine.height_m, "%.6g", ",")
"""
FILES = f"""
mkdir scans results
python -c '{STANDS_FOR}'
printf 'scan,preload_N\\nscans/one.x3p,300\\n' > scans.csv
cp sample_surfaces/damping/measured_assembly.csv measured.csv
capslip analyze face.x3p --out results/face --no-figures --no-render
ln -s results/face RESULT
"""


def commands_in_text(text: str) -> list[str]:
    """Return the commands of a page that stand in no `{run}` block, each on one line."""
    plain = FENCED.sub("", text)
    found = INDENTED.findall(plain) + INLINE.findall(plain)
    return [re.sub(r"\\\n\s*", "", command).strip() for command in found]


def to_run(pages: list[Path]) -> list[str]:
    """Return the commands of some pages that can run here, each once, without pictures."""
    found: dict[str, None] = {}
    for page in pages:
        for command in commands_in_text(page.read_text(encoding="utf-8")):
            command = command.removesuffix(" ...")
            _, name, *more = command.split()
            if name in MINUTES or CLUSTER in more or not (more or name in ALONE):
                continue
            found[command + " --no-figures --no-render" * (name in ("analyze", "batch"))] = None
    return list(found)


def run_shown(_: object) -> None:
    """Run them all in one folder, unless they passed as they are."""
    from run import run_shell
    from sphinx.util import logging

    commands = to_run(PAGES)
    known = (code_sha256(), Path(__file__).read_text(encoding="utf-8"), *commands)
    digest = hashlib.sha256("\0".join(known).encode()).hexdigest()
    if PASSED.exists() and PASSED.read_text(encoding="utf-8") == digest:
        return
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    (FOLDER / "sample_surfaces").symlink_to(PROJECT / "sample_surfaces")
    failed = False
    for command in (FILES, *commands):
        done = run_shell(command, FOLDER, SLURM_ARRAY_TASK_ID="1")
        if done.returncode != 0:
            failed = True
            logging.getLogger(__name__).warning(
                "%r ended with %s\n%s", command, done.returncode, done.stdout
            )
    if not failed:
        PASSED.write_text(digest, encoding="utf-8")


def setup(app) -> dict[str, bool]:
    """Run them before the pages are read."""
    app.connect("builder-inited", run_shown)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
