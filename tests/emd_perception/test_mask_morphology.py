"""Tests of masks' components: against plain NumPy."""

import numpy as np

from emd_perception.mask_morphology import component_sums, dilate, label_components


def test_components_are_summed_up_and_counted() -> None:
    """Sums of weights and counts of marked pixels, label by label, the background too."""
    rng = np.random.default_rng(0)
    count, labels = label_components(rng.random((30, 40)) < 0.2)
    weights, marked = rng.random(labels.shape).astype(np.float32), rng.random(labels.shape) < 0.5
    assert count > 20
    sums, counts = component_sums(labels, count, weights, marked)
    for label in range(count):
        np.testing.assert_allclose(sums[label], weights[labels == label].sum(), rtol=1e-5)
        assert counts[label] == marked[labels == label].sum()


def test_a_part_of_a_mask_is_as_good_as_a_mask() -> None:
    """Windows, whose rows are not beside each other in memory, are grown like copies of them."""
    mask = np.random.default_rng(1).random((40, 50)) < 0.05
    window = mask[5:30, 7:44]
    np.testing.assert_array_equal(dilate(window, 5), dilate(window.copy(), 5))
    assert not dilate(window, 5)[~dilate(mask, 5)[5:30, 7:44]].any()
