"""A hemisphere

Half of a sphere: a wall cuts it, and the mesh ends at the equator, in red, seen from below. Its vertices
there are on the equator, and no triangle crosses it.
"""

import stellate

upper = stellate.oracles.HalfSpace([0, 0, 1])
mesh = stellate.mesh(stellate.oracles.Clipped(stellate.manifolds.Sphere(2), [upper]), epsilon=0.15)

(equator,) = mesh.boundary
axes = mesh.plot(color=2, frame=False)
rim = stellate.Mesh(mesh.points, equator.simplices)
rim.plot(ax=axes, color="crimson", frame=False, view=(-25, -60))
axes.figure.savefig("hemisphere.png")
