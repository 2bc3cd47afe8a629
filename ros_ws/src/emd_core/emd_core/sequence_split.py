"""Which sequences of a data set are for training and which for nothing but the final test."""

from __future__ import annotations

import hashlib

from emd_core.errors import InvalidInputError

SPLITS = ("all", "train", "test")
_TEST_SHARE = 0.1


def in_split(index: int, split: str) -> bool:
    """Whether the sequence of this index belongs to a split: all, train, or test (a tenth).

    It depends on the index alone, so a data set can grow and no sequence changes sides.

    Raises:
        InvalidInputError: If there is no such split.
    """
    if split not in SPLITS:
        raise InvalidInputError(f"a split must be one of {', '.join(SPLITS)}, got {split!r}")
    digest = hashlib.sha256(str(index).encode()).digest()
    test = int.from_bytes(digest[:4], "big") < _TEST_SHARE * 2**32
    return split == "all" or test == (split == "test")
