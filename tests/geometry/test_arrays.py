"""The vector product against numpy's, to the last bit."""

import numpy as np
import pytest

from miurafab.geometry.arrays import group_means, nearest_to_means, vector_product


@pytest.mark.parametrize(
    ("one", "other"),
    [((3,), (3,)), ((7, 3), (3,)), ((7, 3), (7, 3)), ((4, 1, 3), (5, 3)), ((0, 3), (0, 3))],
)
def test_the_vector_product_is_that_of_numpy(one, other):
    random = np.random.default_rng(2)
    a, b = random.normal(size=one), random.normal(size=other)
    product, expected = vector_product(a, b), np.cross(a, b)
    assert product.shape == expected.shape
    assert (product == expected).all()


def test_the_point_of_each_group_nearest_to_its_mean_is_the_first_of_equals():
    points = np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 1.0], [2.0, -1.0], [7.0, 7.0]])
    group = np.array([0, 0, 0, 0, 1])
    assert group_means(points, group).tolist() == [[2.0, 0.0], [7.0, 7.0]]
    assert nearest_to_means(points, group).tolist() == [2, 4]
