"""Conformations of cycloheptane

A ring of seven carbon atoms, all bonds of one length and at the tetrahedral angle. It is not rigid:
it moves along closed curves in R^12, one of chairs and one of boats. Three atoms are held; the picture
shows how far three of the others are out of the plane of those.
"""

import numpy as np
import stellate

bond = 1.53  # angstroms
across = bond * np.sqrt(8 / 3)  # between the neighbours of an atom: an angle of 109.47 degrees
bars = [(i, (i + j) % 7, length) for i in range(7) for j, length in ((1, bond), (2, across))]
held = {0: (-across / 2, 0, 0), 1: (0, bond / np.sqrt(3), 0), 2: (across / 2, 0, 0)}
free = [bar for bar in bars if not (bar[0] in held and bar[1] in held)]
ring = stellate.oracles.Linkage(free, fixed=held)
mesh = stellate.mesh(ring, epsilon=0.1)

axes = mesh.plot(coordinates=[2, 5, 11], color=8, colormap="coolwarm", view=(20, 20))
axes.figure.savefig("cycloheptane.png")
