"""Pairs of one moment."""

from hypothesis import given
from hypothesis import strategies as st

from emd_core.pair_matcher import PairMatcher


def matcher(waiting: int = 5) -> PairMatcher[str]:
    """Colour and depth, 2 apart at most."""
    return PairMatcher(("colour", "depth"), tolerance=2, waiting=waiting)


def test_bursts_of_one_kind_still_make_pairs() -> None:
    """c1 c2 d1 d2 gives both pairs, in the order of the kinds."""
    found = matcher()
    assert found.add("colour", 10, "c1") is None
    assert found.add("colour", 20, "c2") is None
    assert found.add("depth", 11, "d1") == ("c1", "d1")
    assert found.add("depth", 21, "d2") == ("c2", "d2")
    assert (found.unpaired, found.waiting) == (0, 0)


def test_what_is_older_than_a_pair_is_given_up() -> None:
    """A colour image whose depth was lost is counted once a later pair is there."""
    found = matcher()
    found.add("colour", 10, "c1")
    found.add("depth", 20, "d2")
    assert found.add("colour", 20, "c2") == ("c2", "d2")
    assert (found.unpaired, found.waiting) == (1, 0)


def test_only_a_few_wait() -> None:
    """A kind without partners does not fill the memory."""
    found = matcher(waiting=3)
    for stamp in range(0, 100, 10):
        found.add("colour", stamp, "c")
    assert (found.unpaired, found.waiting) == (7, 3)


@given(st.lists(st.tuples(st.sampled_from(["colour", "depth"]), st.integers(0, 60)), max_size=40))
def test_every_item_is_paired_waiting_or_given_up(items) -> None:
    """Nothing is lost or used twice, and pairs are within the tolerance."""
    found = matcher()
    paired = []
    for number, (kind, stamp) in enumerate(items):
        pair = found.add(kind, stamp, (kind, stamp, number))
        if pair is not None:
            assert [item[0] for item in pair] == ["colour", "depth"]
            assert abs(pair[0][1] - pair[1][1]) <= 2
            paired += pair
    assert len(paired) == len(set(paired))
    assert len(paired) + found.waiting + found.unpaired == len(items)
