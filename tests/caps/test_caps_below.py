"""A second family below the cut: named where a deeper cut shows it beside the same first."""

from types import SimpleNamespace

import pytest

from capslip.caps.below import family_below_cut


def families(m, n):
    return SimpleNamespace(count=1 + (n > 0), m=m, n=n)


def found(n_of_cut, m_of_cut=lambda cut: 5, cut=0.10):
    """Return the problems of a face with so many caps above each cut."""

    def counted(ratio):
        return families(m_of_cut(ratio), n_of_cut(ratio))

    return family_below_cut(counted(cut), cut, counted)


def test_a_family_that_only_a_deeper_cut_shows_is_named():
    for least, cut in ((0.15, 0.10), (0.20, 0.10), (0.08, 0.04)):
        (problem,) = found(lambda ratio, least=least: 18 * (ratio >= least - 1e-9), cut=cut)
        assert (problem.code, problem.severity) == ("family_below_cut", "warning")
        assert f"a cut of {100 * least:g} % shows 18 P-caps beside the 5 G-caps" in problem.message


@pytest.mark.parametrize(
    ("n_of_cut", "m_of_cut"),
    [
        (lambda cut: 18, lambda cut: 5),  # nothing is hidden
        (lambda cut: 18 * (cut >= 0.25), lambda cut: 5),  # too deep to be of the same face
        (lambda cut: 1 * (cut >= 0.15), lambda cut: 5),  # one piece: the floor
        (lambda cut: 18 * (cut >= 0.15), lambda cut: 5 + 9 * (cut >= 0.15)),  # another G
    ],
)
def test_no_family_below_the_cut_where_there_is_none(n_of_cut, m_of_cut):
    assert found(n_of_cut, m_of_cut) == []


def test_the_whole_face_is_the_deepest_cut():
    def counted(ratio):
        assert ratio < 1.0
        return families(5, 0)

    assert family_below_cut(families(5, 0), 0.6, counted) == []
