"""The Fermi surface of copper

Electrons of the highest energy, by their wave vectors: a sphere with eight necks, to where it comes again in
the next Brillouin zone. Three harmonics of the lattice, fitted to three measured radii: towards [100], towards
[110], and of a neck. It repeats, so it is meshed on a periodic cell, and drawn in the first zone; what it
encloses is half of that, as copper has one such electron an atom, to within a percent.
"""

import itertools

import numpy as np
import stellate
from stellate import oracles

lattice = np.array([[-1, 1, 1], [1, -1, 1], [1, 1, -1]])  # of wave vectors, in 2 pi / a
sphere = (3 / (2 * np.pi)) ** (1 / 3)  # the radius, if electrons were free
measured = sphere * np.array([[1.058, 0, 0], [0.667, 0.667, 0], [0.1326, -0.1326, 0]])
measured[2] += 0.5  # a neck is about (1/2, 1/2, 1/2)


def harmonics(k):
    c, d = np.cos(np.pi * k), np.cos(2 * np.pi * k)
    pairs = c * np.roll(c, 1, axis=1)
    return np.stack([pairs, d, d * np.roll(pairs, 1, axis=1)]).sum(axis=2)


first, second, third = harmonics(measured)
b, c, level = np.linalg.solve(np.stack([second, third, -np.ones(3)], axis=1), -first)
cell = oracles.PeriodicCell(lattice)
surface = cell.level_set(lambda k: np.array([1, b, c]) @ harmonics(k) - level)
mesh = stellate.mesh(surface, epsilon=0.04)

corners = mesh.unwrap(cell).corners()
near = np.array(list(itertools.product((-1, 0, 1), repeat=3))) @ lattice
to = ((corners.mean(axis=1)[:, None] - near) ** 2).sum(axis=2).argmin(axis=1)
corners = corners - near[to][:, None]  # each triangle in the first zone
zone = stellate.Mesh(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
axes = zone.plot(color=-(zone.points**2).sum(axis=1), colormap="copper", frame=False, view=(16, 20))
ends = [p for x in (-1, 1) for y in (-0.5, 0.5) for p in itertools.permutations((x, y, 0))]
pairs = [pair for pair in itertools.combinations(ends, 2) if np.ptp(pair, axis=0).max() < 0.6]
axes.computed_zorder = False
for one, other in pairs:  # the edges of the zone, in front and behind
    axes.plot(*zip(one, other), "k", linewidth=0.8, zorder=np.add(one, other) @ [0.9, 0.33, 0.28])
axes.figure.savefig("copper.png")
