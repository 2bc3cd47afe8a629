"""One operator at a time."""

import pytest

from emd_console.operator_lease import ABSENCE, ASK_TIMEOUT, OperatorLease
from emd_core.errors import BusyError


class Clock:
    """Seconds that pass when told to."""

    now = 0.0

    def __call__(self) -> float:
        """Give the time."""
        return self.now


@pytest.fixture
def clock() -> Clock:
    """A clock at zero."""
    return Clock()


@pytest.fixture
def lease(clock) -> OperatorLease:
    """A lease that `ada` holds."""
    made = OperatorLease(clock)
    assert made.take("ada", "Ada")
    return made


def test_the_second_waits_and_gets_it_by_consent(lease) -> None:
    """And only then may command."""
    assert not lease.take("bob", "Bob")
    with pytest.raises(BusyError, match="Ada commands"):
        lease.require("bob")
    lease.consent("bob")  # cannot consent for the holder
    assert lease.holder == "ada"
    lease.consent("ada")
    lease.require("bob")


def test_a_holder_who_does_not_answer_loses_it(lease, clock) -> None:
    """After the timeout, though present."""
    lease.take("bob", "Bob")
    clock.now = ASK_TIMEOUT - 1
    lease.seen("ada")
    assert lease.holder == "ada" and lease.asked_by == ("Bob", 1.0)
    clock.now = ASK_TIMEOUT + 1
    lease.seen("ada")
    assert lease.holder == "bob"


def test_a_holder_may_keep_it(lease, clock) -> None:
    """The question is gone, and may be asked again."""
    lease.take("bob", "Bob")
    lease.refuse("ada")
    for clock.now in range(0, 60, 5):
        lease.seen("ada")
        assert lease.holder == "ada"
    assert lease.asked_by is None


def test_who_is_gone_holds_nothing(lease, clock) -> None:
    """Whoever comes next takes it at once."""
    clock.now = ABSENCE + 0.1
    assert lease.holder is None
    assert lease.take("bob", "Bob")


def test_who_closes_the_page_hands_over_to_who_asks(lease) -> None:
    """Else to nobody."""
    lease.take("bob", "Bob")
    lease.release("ada")
    assert lease.holder == "bob"
    lease.release("bob")
    with pytest.raises(BusyError, match="nobody commands"):
        lease.require("bob")
