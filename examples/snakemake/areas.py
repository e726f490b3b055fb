"""A table of meshes and their areas: areas.py MESH..."""

import sys

import numpy as np
import stellate

exact = 4 * np.pi**2 * 1.0 * 0.4
print("mesh,vertices,area,error")
for path in sys.argv[1:]:
    mesh = stellate.load_txt(path)
    a, b, c = (mesh.points[mesh.simplices[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    print(f"{path},{len(mesh.points)},{area:.6f},{area / exact - 1:.6f}")
