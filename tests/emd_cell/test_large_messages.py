"""Transports for whole images: chosen where nobody has chosen others."""

import os
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from emd_cell import large_messages
from emd_cell.large_messages import PROFILE, ROOM, use_large_messages

FILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
CHOSEN = (*FILES, "FASTDDS_BUILTIN_TRANSPORTS")


@pytest.fixture(autouse=True)
def nothing_chosen(monkeypatch) -> None:
    """An environment without a choice, put back afterwards."""
    for name in CHOSEN:
        monkeypatch.setenv(name, "")


def test_the_profile_is_used_where_nothing_was_chosen() -> None:
    """Processes started from now on read it."""
    use_large_messages()
    assert [os.environ[name] for name in FILES] == [str(PROFILE)] * 2


@pytest.mark.parametrize("name", CHOSEN)
def test_the_users_choice_stays(name: str, monkeypatch) -> None:
    """Whoever set a profile or transports keeps them, and gets no others beside."""
    monkeypatch.setenv(name, "chosen")
    use_large_messages()
    assert {os.environ[other] for other in CHOSEN} == {"", "chosen"}
    assert os.environ[name] == "chosen"


@pytest.mark.parametrize(("free", "used"), [(ROOM, True), (ROOM - 1, False)])
def test_small_shared_memory_is_left_alone(free: int, used: bool, monkeypatch) -> None:
    """In a container with little of it, the usual transports stay."""
    usage = SimpleNamespace(free=free)
    monkeypatch.setattr(large_messages.shutil, "disk_usage", lambda path: usage)
    use_large_messages()
    assert (os.environ[FILES[0]] == str(PROFILE)) == used


def test_an_image_fits_into_the_memory_and_the_sockets() -> None:
    """Room for five colour images of 1280 x 720, and for one of 640 x 480 in a socket."""
    sizes = {
        part.tag.rpartition("}")[2]: int(part.text or 0)
        for part in ElementTree.parse(PROFILE).iter()
        if (part.text or "").strip().isdigit()
    }
    assert sizes["segment_size"] >= 5 * 3 * 1280 * 720
    assert sizes["maxMessageSize"] >= 3 * 1280 * 720
    assert sizes["receiveBufferSize"] >= 3 * 640 * 480
