"""Who may see and command."""

import pytest

from emd_console.access import AccessPolicy, Role, Tokens, is_loopback
from emd_core.errors import InvalidInputError

HERE = {"host": "127.0.0.1:8765"}


def test_without_tokens_everybody_on_this_machine_operates() -> None:
    """Loopback needs none."""
    policy = AccessPolicy("127.0.0.1", 8765)
    assert policy.role(None) is Role.OPERATOR and policy.believes(HERE)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "example.org", "::"])
def test_beyond_this_machine_tokens_are_a_must(host) -> None:
    """The policy cannot even be made."""
    with pytest.raises(InvalidInputError, match="tokens"):
        AccessPolicy(host, 8765)


def test_a_token_gives_its_role_and_a_wrong_one_nothing() -> None:
    """Nor does a missing one, nor the beginning of a right one."""
    tokens = Tokens()
    policy = AccessPolicy("0.0.0.0", 8765, tokens)
    assert policy.role(tokens.operator) is Role.OPERATOR
    assert policy.role(tokens.viewer) is Role.VIEWER
    for wrong in (None, "", "x" * 32, tokens.operator[:-1], tokens.viewer + "x", "ä\ud800"):
        assert policy.role(wrong) is None


def test_tokens_are_long_and_different_and_not_shown() -> None:
    """They do not appear where an object is printed."""
    tokens = Tokens()
    assert min(len(tokens.operator), len(tokens.viewer)) >= 32
    assert tokens.operator not in repr(tokens)
    with pytest.raises(InvalidInputError, match="characters"):
        Tokens("short", "also short")
    with pytest.raises(InvalidInputError, match="different"):
        Tokens("a" * 20, "a" * 20)


@pytest.mark.parametrize(
    "headers",
    [
        {**HERE, "origin": "http://evil.example"},
        {**HERE, "origin": "null"},
        {**HERE, "origin": "http://127.0.0.1:9999"},
        {"host": "evil.example:8765"},
        {"host": "evil.example:8765", "origin": "http://evil.example:8765"},
        {"host": "127.0.0.1.evil.example"},
        {},
    ],
)
def test_pages_of_other_sites_are_not_believed(headers) -> None:
    """Neither another origin, nor a name that was bent to this address."""
    assert not AccessPolicy("127.0.0.1", 8765).believes(headers)


def test_the_consoles_own_page_is_believed() -> None:
    """By address, by name, by IPv6."""
    policy = AccessPolicy("127.0.0.1", 8765)
    for host in ("127.0.0.1:8765", "localhost:8765", "[::1]:8765"):
        assert policy.believes({"host": host, "origin": f"http://{host}"})


def test_loopback_is_told_from_the_world() -> None:
    """All of 127/8, ::1 and localhost."""
    assert all(map(is_loopback, ("127.0.0.1", "127.3.2.1", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "10.0.0.1", "", "localhost.evil.example")))
