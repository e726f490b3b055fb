"""Thirty-three solids as people write them in numpy: p (n, 3) -> (n,), negative inside, within [-1.3, 1.3]^3.

Of each: how many walls it is traced to, an epsilon that is fine enough for it, and its Euler
characteristic. Ten more that no walls can be made of.
"""

import numpy as np

norm = np.linalg.norm
BOX = [-1.3] * 3, [1.3] * 3


# What others are made of.


def ball(p, radius, centre=(0.0, 0.0, 0.0)):
    return norm(p - np.array(centre), axis=1) - radius


def box(p, half):
    q = np.abs(p) - np.array(half)
    return norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def rod(p, axis, radius):
    """A cylinder without ends."""
    i, j = [i for i in range(3) if i != axis]
    return np.hypot(p[:, i], p[:, j]) - radius


def smooth_minimum(a, b, k):
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * k / 4


# Primitives.


def rounded_cylinder(p):
    d = np.stack([np.hypot(p[:, 0], p[:, 1]) - 0.6, np.abs(p[:, 2]) - 0.4], axis=1)
    return np.minimum(d.max(axis=1), 0) + norm(np.maximum(d, 0), axis=1) - 0.2


def capped_cone(p):
    """Of radii 0.9 below and 0.5 above, by half-spaces of the meridian plane."""
    r, z = np.hypot(p[:, 0], p[:, 1]), p[:, 2]
    slope = np.array([1.4, 0.4]) / np.hypot(1.4, 0.4)
    return np.maximum(np.abs(z) - 0.7, slope[0] * (r - 0.7) + slope[1] * z)


def round_cone(p):
    """A ball of 0.5, a smaller one above it, and the cone that touches both: all is one surface."""
    r1, r2, h = 0.5, 0.3, 0.8
    b = (r1 - r2) / h
    a = np.sqrt(1 - b * b)
    q0, q1 = np.hypot(p[:, 0], p[:, 1]), p[:, 2] + 0.4
    k = a * q1 - b * q0
    low, high = np.hypot(q0, q1) - r1, np.hypot(q0, q1 - h) - r2
    return np.where(k < 0, low, np.where(k > a * h, high, a * q0 + b * q1 - r1))


def hexagonal_prism(p):
    k = np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)], [-0.5, np.sqrt(0.75)]])
    return np.maximum(np.abs(p[:, :2] @ k.T).max(axis=1) - 0.8, np.abs(p[:, 2]) - 0.5)


def folded_hexagon(p):
    """The same by folding the plane onto a twelfth of it, as distances to polygons are written."""
    k, corner = np.array([-np.sqrt(0.75), 0.5]), 0.8 * np.tan(np.pi / 6)
    q = np.abs(p[:, :2])
    q = q - 2 * np.minimum(q @ k, 0)[:, None] * k
    e = np.stack([q[:, 0] - np.clip(q[:, 0], -corner, corner), q[:, 1] - 0.8], axis=1)
    return np.maximum(norm(e, axis=1) * np.sign(e[:, 1]), np.abs(p[:, 2]) - 0.5)


def rod_by_squares(p):
    """A cylinder with ends, by squares, of which the root is taken last."""
    x, y = np.hypot(p[:, 0], p[:, 1]) - 0.5, np.abs(p[:, 2]) - 0.8
    x2, y2 = x * x, 4 * y * y
    beyond = np.where(x > 0, x2, 0) + np.where(y > 0, y2, 0)
    d = np.where(np.maximum(x, y) < 0, -np.minimum(x2, y2), beyond)
    return np.sign(d) * np.sqrt(np.abs(d))


def triangular_prism(p):
    q = np.abs(p)
    return np.maximum(q[:, 2] - 0.6, np.maximum(q[:, 0] * 0.866025 + p[:, 1] * 0.5, -p[:, 1]) - 0.4)


def box_frame(p):
    """The edges of a box, as beams of a square section."""
    e = 0.25
    p = np.abs(p) - np.array([0.9, 0.8, 0.7])
    q = np.abs(p + e) - e
    beams = [np.stack(columns, axis=1) for columns in (
        [p[:, 0], q[:, 1], q[:, 2]], [q[:, 0], p[:, 1], q[:, 2]], [q[:, 0], q[:, 1], p[:, 2]]
    )]  # fmt: skip
    distances = [norm(np.maximum(b, 0), axis=1) + np.minimum(b.max(axis=1), 0) for b in beams]
    return np.minimum(np.minimum(distances[0], distances[1]), distances[2])


def pyramid(p):
    sides = (np.abs(p[:, :2]).max(axis=1) * 1.2 + (p[:, 2] - 0.8) * 0.8) / np.hypot(1.2, 0.8)
    return np.maximum(sides, -p[:, 2] - 0.5)


def tetrahedron(p):
    x, y, z = p.T
    return np.maximum(np.abs(x + y) - z, np.abs(x - y) + z) / np.sqrt(3) - 0.45


def dodecahedron(p):
    golden = (1 + np.sqrt(5)) / 2
    normals = np.array([[0, 1, golden], [0, -1, golden], [1, golden, 0], [-1, golden, 0],
                        [golden, 0, 1], [-golden, 0, 1]])  # fmt: skip
    return np.amax(np.absolute(p @ normals.T), axis=1) / np.hypot(1, golden) - 0.9


def solid_angle(p):
    """A ball's part within a cone about z."""
    q = np.stack([np.hypot(p[:, 0], p[:, 1]), p[:, 2]], axis=1)
    c = np.array([np.sin(0.9), np.cos(0.9)])
    side = q[:, 0] * c[1] - q[:, 1] * c[0]
    return np.maximum(np.maximum(norm(p, axis=1) - 1.1, side), 0.3 - p[:, 2])


def cut_sphere(p):
    return np.maximum(ball(p, 1.0), p[:, 2] - 0.3)


def capped_torus(p):
    """Three quarters of a torus with round ends."""
    c = np.array([np.sin(2.2), np.cos(2.2)])
    x = np.abs(p[:, 0])
    along = np.where(c[1] * x > c[0] * p[:, 1], x * c[0] + p[:, 1] * c[1], np.hypot(x, p[:, 1]))
    return np.sqrt((p * p).sum(axis=1) + 0.49 - 1.4 * along) - 0.25


def square_ring(p):
    """A rectangle that goes round about z."""
    q = np.abs(np.column_stack([np.hypot(p[:, 0], p[:, 1]) - 0.8, p[:, 2]])) - [0.25, 0.3]
    return norm(np.maximum(q, 0), axis=1) + np.minimum(np.maximum(q[:, 0], q[:, 1]), 0)


def superellipsoid(p):
    return (np.abs(p / np.array([1.0, 0.8, 0.6])) ** 3).sum(axis=1) ** (1 / 3) - 1


# Operations.


def moon(p):
    return np.maximum(ball(p, 1), -ball(p, 0.8, (0.7, 0, 0)))


def cavity_with_a_mouth(p):
    """A hollow ball, open above."""
    return np.maximum(np.abs(ball(p, 0.9)) - 0.15, p[:, 2] - 0.5)


def three_rods(p):
    """What three cylinders have in common, none of one radius: two such touch."""
    return np.stack([rod(p, i, r) for i, r in enumerate([0.9, 0.8, 0.7])], axis=1).max(axis=1)


def cross_of_rods(p):
    """All of three cylinders, within a ball."""
    rods = np.minimum(np.minimum(rod(p, 0, 0.35), rod(p, 1, 0.35)), rod(p, 2, 0.35))
    return np.maximum(rods, ball(p, 1.1))


def curved_tetrahedron(p):
    """What four balls about the corners of a tetrahedron have in common."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.5
    result = ball(p, 1.5, corners[0])
    for corner in corners[1:]:
        result = np.maximum(result, ball(p, 1.5, corner))
    return result


def melted_pair(p):
    return smooth_minimum(
        ball(p, 0.5, (-0.4, 0, 0)), box(p - [0.45, 0, 0], [0.3, 0.3, 0.3]) - 0.15, 0.3
    )


def smooth_bite(p):
    """A ball of which a smaller one is taken away, smoothly."""
    a, b = ball(p, 0.9), ball(p, 0.5, (0.8, 0, 0))
    return -smooth_minimum(-a, b, 0.3)


def chamfered_union(p):
    a, b = box(p - [0, 0, -0.4], [0.9, 0.9, 0.3]), rod(p, 2, 0.4)
    b = np.maximum(b, np.abs(p[:, 2] - 0.3) - 0.6)
    return np.minimum(np.minimum(a, b), (a - 0.15 + b) * np.sqrt(0.5))


def mirrored(p):
    """A ball and its mirror image, by the absolute value of x."""
    q = np.stack([np.abs(p[:, 0]), p[:, 1], p[:, 2]], axis=1)
    return norm(q - np.array([0.45, 0, 0]), axis=1) - 0.6


def elongated(p):
    """A torus drawn out along y."""
    q = np.stack([p[:, 0], p[:, 1] - np.clip(p[:, 1], -0.35, 0.35), p[:, 2]], axis=1)
    return np.hypot(np.hypot(q[:, 0], q[:, 1]) - 0.6, q[:, 2]) - 0.22


def twisted(p):
    """A square bar, turned by z."""
    c, s = np.cos(0.8 * p[:, 2]), np.sin(0.8 * p[:, 2])
    x, y = c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1]
    return np.maximum(np.maximum(np.abs(x), np.abs(y)) - 0.5, np.abs(p[:, 2]) - 0.9)


def bumpy(p):
    return ball(p, 0.9) + 0.05 * np.sin(6 * p[:, 0]) * np.sin(6 * p[:, 1]) * np.sin(6 * p[:, 2])


def plus_sign(p):
    """A cross, extruded."""
    x, y = np.abs(p[:, 0]), np.abs(p[:, 1])
    cross = np.minimum(np.maximum(x - 0.9, y - 0.3), np.maximum(x - 0.3, y - 0.9))
    return np.maximum(cross, np.abs(p[:, 2]) - 0.35)


# Parts.


def bolt(p):
    """A hexagonal head, a shank, and a bore along it."""
    k = np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)], [-0.5, np.sqrt(0.75)]])
    head = np.maximum(np.abs(p[:, :2] @ k.T).max(axis=1) - 0.8, np.abs(p[:, 2] - 0.7) - 0.25)
    shank = np.maximum(rod(p, 2, 0.5), np.abs(p[:, 2] - 0.1) - 1.1)
    return np.maximum(np.minimum(head, shank), 0.25 - np.hypot(p[:, 0], p[:, 1]))


def tray(p):
    """A box, a smaller one taken out of it from above."""
    return np.maximum(box(p, [1.0, 0.7, 0.4]), -box(p - [0, 0, 0.3], [0.8, 0.5, 0.5]))


def flange(p):
    """A disc with a pipe on it and four holes, which a loop makes."""
    f = np.maximum(rod(p, 2, 1.1), np.abs(p[:, 2] + 0.3) - 0.15)
    f = np.minimum(f, np.maximum(rod(p, 2, 0.5), np.abs(p[:, 2] - 0.1) - 0.55))
    f = np.maximum(f, -rod(p, 2, 0.3))
    for i in range(4):
        at = [0.8 * np.cos(i * np.pi / 2), 0.8 * np.sin(i * np.pi / 2), 0]
        f = np.maximum(f, -rod(p - np.array(at), 2, 0.13))
    return f


def lattice_in_a_rod(p):
    """A level set, cut by a cylinder."""
    s, c = np.sin(3.5 * p), np.cos(3.5 * p)
    gyroid = s[:, 0] * c[:, 1] + s[:, 1] * c[:, 2] + s[:, 2] * c[:, 0]
    return np.maximum(-gyroid - 0.2, np.maximum(rod(p, 2, 1.0), np.abs(p[:, 2]) - 0.9))


# Function, walls, an epsilon, the Euler characteristic.
FORMULAS = [
    (rounded_cylinder, 1, 0.1, 1),
    (capped_cone, 2, 0.2, 1),
    (round_cone, 1, 0.1, 1),
    (hexagonal_prism, 7, 0.2, 1),
    (folded_hexagon, 5, 0.2, 1),
    (rod_by_squares, 2, 0.15, 1),
    (triangular_prism, 4, 0.2, 1),
    (box_frame, 8, 0.2, -4),
    (pyramid, 5, 0.2, 1),
    (tetrahedron, 4, 0.2, 1),
    (dodecahedron, 6, 0.25, 1),
    (solid_angle, 3, 0.15, 1),
    (cut_sphere, 2, 0.2, 1),
    (capped_torus, 1, 0.08, 1),
    (square_ring, 2, 0.2, 0),
    (superellipsoid, 1, 0.12, 1),
    (moon, 2, 0.15, 1),
    (cavity_with_a_mouth, 2, 0.1, 1),
    (three_rods, 3, 0.15, 1),
    (cross_of_rods, 4, 0.12, 1),
    (curved_tetrahedron, 4, 0.15, 1),
    (melted_pair, 1, 0.05, 1),
    (smooth_bite, 1, 0.08, 1),
    (chamfered_union, 7, 0.12, 1),
    (mirrored, 2, 0.15, 1),
    (elongated, 1, 0.08, 0),
    (twisted, 3, 0.15, 1),
    (bumpy, 1, 0.05, 1),
    (plus_sign, 5, 0.2, 1),
    (bolt, 10, 0.15, 0),
    (tray, 6, 0.2, 1),
    (flange, 10, 0.1, -4),
    (lattice_in_a_rod, 3, 0.12, None),
]


# What has no smooth walls that could be found, and a word of what is said of each.


def as_if_for_one(p):
    return max(abs(p[:, 0]), abs(p[:, 1]), abs(p[:, 2])) - 1.0


def by_python_if(p):
    if p[:, 2] > 0:
        return ball(p, 1)
    return ball(p, 0.8)


def point_by_point(p):
    return np.array([norm(x) - 1 for x in p])


def repeated(p):
    return norm(np.mod(p + 0.5, 1.0) - 0.5, axis=1) - 0.3


def nearest_cell(p):
    return norm(p - 0.5 * np.rint(p / 0.5), axis=1) - 0.15


def stairs(p):
    return p[:, 2] - 0.2 * np.floor(p[:, 0] / 0.2)


def table_of_values(p):
    return np.interp(p[:, 0], [-1.0, 0.0, 1.0], [-0.5, 0.3, -0.5])


def centred(p):
    q = p - p.mean(axis=0)
    return norm(q, axis=1) - 1


def written_in_place(p):
    f = ball(p, 1)
    f[p[:, 2] > 0.5] = 1.0
    return f


def einsum_of_rows(p):
    return np.sqrt(np.einsum("ij,ij->i", p, p)) - 1


REFUSED = [
    (as_if_for_one, "branches on values"),
    (by_python_if, "branches on values"),
    (point_by_point, "one by one"),
    (repeated, "periodic cell"),
    (nearest_cell, "periodic cell"),
    (stairs, "periodic cell"),
    (table_of_values, "numpy.interp is not traced"),
    (centred, "reduces over its points"),
    (written_in_place, "by a mask"),
    (einsum_of_rows, "numpy.einsum is not traced"),
]
