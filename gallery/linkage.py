"""A five-bar linkage

Five equal bars in a ring, one of them held fast. All positions of the other three joints are a surface
in R^6, of genus 4. It is drawn over three of the six coordinates; the colour is the middle joint's
height.
"""

import stellate

bars = [("a", "p", 1.0), ("p", "q", 1.0), ("q", "r", 1.0), ("r", "b", 1.0)]
linkage = stellate.oracles.Linkage(bars, fixed={"a": (0, 0), "b": (1, 0)})
mesh = stellate.mesh(linkage, epsilon=0.3, size_rate=0.4)

height = linkage.joints(mesh.points)["q"][:, 1]
slanted = [[1, 0, 0.3, 0, 0, 0], [0, 1, 0, 0.3, 0, 0], [0, 0, 0, 0.2, 0.3, 1]]
axes = mesh.plot(coordinates=slanted, color=height, frame=False, view=(35, 30))
axes.figure.savefig("linkage.png")
