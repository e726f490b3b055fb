"""The surface; any oracle of yours could stand here."""

import stellate

torus = stellate.manifolds.Torus(major=1.0, minor=0.4)
