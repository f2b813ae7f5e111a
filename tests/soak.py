"""Long checks of `make soak`: random contact scenes, damaged files, and a fleet that is killed.

10,000 scenes; 20,000 files a format and 1,000 of each maker's, where the folder of real scans lies
beside the project; 1,000 of each that know their length, with bytes lost or slipped in; 500 scans
of which 38 are bad, killed 50 times: the batch, a worker, a Dask scheduler or what works for it.
"""

import sys
import tempfile
from pathlib import Path

sys.path.extend(
    str(Path(__file__).parent / wing) for wing in ("contact", "surface", "command_line")
)

from fleet_cases import soak_fleet
from fuzz_readers import fuzz_lengths, fuzz_readers, fuzz_vendor
from test_contact_interacting import solve_random_scenes

if __name__ == "__main__":
    worst, slowest_s = solve_random_scenes(10_000, seed=1)
    print(f"10000 random scenes: worst misfit {worst:.2g}, slowest solve {slowest_s:.2g} s")
    scans = Path(__file__).parents[2] / "shared" / "scans"
    results = (*fuzz_readers(20_000, seed=1), *fuzz_vendor(1_000, scans, seed=1))
    for result in results:
        print(
            f"{result.name:10} read {result.n_read}, refused {result.n_refused}, failures", end=" "
        )
        print(len(result.failures))
    silent = fuzz_lengths(1_000, scans, seed=1)
    print(f"bytes lost or slipped in: {silent or 'no map changed in silence'}")
    with tempfile.TemporaryDirectory() as folder:
        wrong = soak_fleet(Path(folder))
    print(f"500 scans, 38 bad, 50 kills: {wrong or 'as it should be'}")
    sys.exit(bool(wrong or silent) or worst > 1e-9 or any(result.failures for result in results))
