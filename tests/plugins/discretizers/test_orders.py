"""Observed orders of convergence on a manufactured solution: what degrees and weights promise."""

from __future__ import annotations

import pytest
from orders import DISCRETIZERS, NODES, errors, orders


class TestOrdersBetweenTwoSpacings:
    """0.1 and 0.05 mm on the unit square, n = 0.5; power of the spacing with which the error inside falls."""

    least = {  # noqa: RUF012
        "mls, degree 2": 1.8,
        "mls, degree 4": 3.5,
        "rbf r³, degree 2": 1.8,
        "rbf r⁵, degree 4": 2.5,
        "mls, conservative": 1.8,
        "rbf, conservative": 1.6,
        "linear triangles": 1.8,
    }

    @pytest.mark.parametrize("name", least)
    @pytest.mark.parametrize("nodes", NODES)
    def test_order(self, name: str, nodes: str) -> None:
        (order,) = orders(*errors(DISCRETIZERS[name], NODES[nodes], 0.5, (0.1, 0.05)))
        assert order >= self.least[name]

    def test_a_higher_degree_is_worth_its_neighbours(self) -> None:
        """Degree 4 against 2 at the same 0.05 mm: a tenth of the error, by either kind of weights."""
        for low, high in (("mls, degree 2", "mls, degree 4"), ("rbf r³, degree 2", "rbf r⁵, degree 4")):
            (_, (two,)), (_, (four,)) = (
                errors(DISCRETIZERS[name], NODES["a jittered grid"], 0.5, (0.05,)) for name in (low, high)
            )
            assert four < 0.1 * two
