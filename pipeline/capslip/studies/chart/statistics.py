"""Errors of many runs in one point a method: median, range, and the front that none beats."""

import math

import numpy as np

from capslip.studies.chart.reference import QUANTITIES
from capslip.studies.page import Row

ENERGY = "energy"  # the worst of the four forces
CAP_QUANTITIES = ("m", "n", "h", "R_G", "R_P")


def points_of(runs: list[Row]) -> list[Row]:
    """Collect median and range over the cases of each group, for each method."""
    methods_met = list(dict.fromkeys((run["line"], run["setting"]) for run in runs))
    points = []
    for line, setting in methods_met:
        mine = [run for run in runs if (run["line"], run["setting"]) == (line, setting)]
        point: Row = {"line": line, "setting": setting, "groups": {}}
        groups = {"all": [run for run in mine if run["group"] != "scan"]}
        for run in mine:
            groups.setdefault(run["group"], []).append(run)
        for group, members in groups.items():
            if members:
                point["groups"][group] = _statistics(members)
        points.append(point)
    return points


def _statistics(runs: list[Row]) -> Row:
    row: Row = {"seconds": median_and_range([run["seconds"] for run in runs])}
    row["failed"] = sum(run["errors"]["approach"] is None for run in runs)
    for name in (*QUANTITIES, ENERGY):
        # A method without a number where the reference has one is infinitely wrong.
        errors = [run["errors"][name] for run in runs if name in run["errors"]]
        row[name] = median_and_range([math.inf if e is None else abs(e) for e in errors])
    for name in CAP_QUANTITIES:
        known = [run["cap_errors"][name] for run in runs if run["cap_errors"]]
        row[name] = median_and_range([abs(e) for e in known if e is not None])
    return row


def median_and_range(values: list[float]) -> list[float | None] | None:
    """Return median, least and greatest; infinite ones as None."""
    if not values:
        return None
    numbers = (float(np.median(values)), min(values), max(values))
    return [float(x) if math.isfinite(x) else None for x in numbers]


def pareto(points: list[Row], quantity: str) -> list[list[str]]:
    """Return line and setting of the points that no faster one equals in the median error."""
    known = []
    for point in points:
        group = point["groups"].get("all")
        if group and group[quantity] and group[quantity][0] is not None:
            known.append((group["seconds"][0], group[quantity][0], point))
    front, least = [], math.inf
    for _, error, point in sorted(known, key=lambda entry: entry[:2]):
        if error < least:
            least = error
            front.append([point["line"], point["setting"]])
    return front
