"""Values of a field between its points, by the quadratic polynomials of the cells; see Snapshot.sample."""

import numpy as np

# Place of VTK's k-th node of a cell in its lattice of three points a direction, first coordinate fastest: corners, edges, (space: faces,) centre
VTK_QUAD = np.array([0, 2, 8, 6, 1, 5, 7, 3, 4])
VTK_HEX = np.array([0, 2, 8, 6, 18, 20, 26, 24, 1, 5, 7, 3, 19, 23, 25, 21, 9, 11, 17, 15, 12, 14, 10, 16, 4, 22, 13])


def _lagrange(xi):
    """Values [..., 3] of the quadratic polynomials of the nodes -1, 0, 1, and their derivatives."""
    return np.stack([xi * (xi - 1) / 2, 1 - xi * xi, xi * (xi + 1) / 2], -1), np.stack([xi - 0.5, -2 * xi, xi + 0.5], -1)


def _shape_functions(xi):
    """Values [n][nodes] at reference places [n][dim] and derivatives [n][nodes][dim], nodes in VTK's order."""
    n, dim = xi.shape
    one = [_lagrange(xi[:, d]) for d in range(dim)]

    def product(derivative):
        out = np.ones((n, 1))
        for d in reversed(range(dim)):  # the first coordinate runs fastest
            out = (out[:, :, None] * one[d][derivative == d][:, None, :]).reshape(n, 3 * out.shape[1])
        return out[:, VTK_QUAD if dim == 2 else VTK_HEX]

    return product(-1), np.stack([product(d) for d in range(dim)], -1)


class Search:
    """The cell that holds a place: bins over the cells' boxes, then Newton's method for the inverse of the cell's map."""

    OUTSIDE = 1e-6  # of a cell: a place on its border belongs to it
    MISS = 1e-5  # of a cell: what Newton's method may leave; where a map is nearly flat it is slow

    def __init__(self, points, cells):
        self.x = points[cells]  # [cells][nodes][dim]
        spread = self.x.max(1) - self.x.min(1)
        slack = 0.05 * spread  # curved sides bulge beyond their nodes
        self.lower, self.upper = self.x.min(1) - slack, self.x.max(1) + slack
        self.origin, self.h = self.lower.min(0), np.median(spread, 0) * 1.5
        self.n = np.maximum(1, np.ceil((self.upper.max(0) - self.origin) / self.h).astype(int))
        first, last = self._bin(self.lower), self._bin(self.upper)
        lists = {}
        for cell, (a, b) in enumerate(zip(first, last)):
            for index in np.ndindex(*(b - a + 1)):
                lists.setdefault(tuple(a + index), []).append(cell)
        self.lists = lists

    def _bin(self, x):
        return np.clip(((x - self.origin) / self.h).astype(int), 0, self.n - 1)

    def find(self, places):
        """Cell of each place (-1: none) and the weights [n][nodes] of its nodes."""
        pairs = [(i, cell) for i, key in enumerate(map(tuple, self._bin(places))) for cell in self.lists.get(key, ())]
        found, weight = np.full(len(places), -1), np.zeros((len(places), self.x.shape[1]))
        if not pairs:
            return found, weight
        place, cell = np.array(pairs).T
        inside = ((places[place] >= self.lower[cell]) & (places[place] <= self.upper[cell])).all(1)
        place, cell = place[inside], cell[inside]
        xi, miss = self._invert(places[place], self.x[cell])
        good = (abs(xi) <= 1 + self.OUTSIDE).all(1) & (miss <= self.MISS * (self.upper - self.lower)[cell].max(1))
        place, cell, xi = place[good], cell[good], xi[good]
        found[place] = cell
        last = {p: i for i, p in enumerate(place)}  # of several cells that share the place, the one taken above
        keep = np.array(list(last.values()), int)
        weight[place[keep]] = _shape_functions(xi[keep])[0]
        return found, weight

    @staticmethod
    def _invert(places, x):
        """Reference coordinates by damped steps, and how far from the places they are."""
        xi = np.zeros_like(places)
        for _ in range(40):
            value, slope = _shape_functions(xi)
            miss = places - np.einsum("nk,nkd->nd", value, x)
            jacobian = np.einsum("nke,nkd->nde", slope, x)
            jacobian[np.linalg.det(jacobian) == 0] += 1e-12 * np.eye(places.shape[1])
            step = np.linalg.solve(jacobian, miss[:, :, None])[:, :, 0] if len(places) else miss
            step /= np.maximum(1, 2 * abs(step).max(1, initial=0))[:, None]
            xi = np.clip(xi + step, -3, 3)
            if not len(places) or abs(step).max() < 1e-13:
                break
        return xi, abs(places - np.einsum("nk,nkd->nd", _shape_functions(xi)[0], x)).max(1, initial=0)
