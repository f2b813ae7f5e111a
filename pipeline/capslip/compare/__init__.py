"""A finished result against measured damping.

`compare_result` reads, compares and, where asked, identifies friction coefficient and preload;
`to_dict`, `lines` and `write_comparison` give what it found, `check_place` where that may stand.
"""

from capslip.compare.comparison import Comparison, compare_result
from capslip.compare.report import check_place, lines, to_dict, write_comparison

__all__ = [
    "Comparison",
    "check_place",
    "compare_result",
    "lines",
    "to_dict",
    "write_comparison",
]
