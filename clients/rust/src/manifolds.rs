//! Two manifolds with oracles in closed form.

use crate::{BoxError, Capabilities, Oracle};

const TANGENTS: Capabilities =
    Capabilities { intersect_flat: false, tangent_basis: true, local_size: false };

/// The torus of tube radius `minor` around a circle of radius `major`: k = 2, d = 3.
#[derive(Clone, Copy, Debug)]
pub struct Torus {
    /// Of the circle.
    pub major: f64,
    /// Of the tube.
    pub minor: f64,
}

impl Default for Torus {
    fn default() -> Self {
        Torus { major: 1.0, minor: 0.4 }
    }
}

impl Oracle for Torus {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn concurrent(&self) -> bool {
        true
    }

    fn capabilities(&self) -> Capabilities {
        TANGENTS
    }

    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let across = 1.1 * (self.major + self.minor);
        let corner = [across, across, 1.1 * self.minor];
        Some((corner.map(|x| -x).to_vec(), corner.to_vec()))
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        for ((x, p), found) in x.chunks_exact(3).zip(points.chunks_exact_mut(3)).zip(found) {
            let ring = (x[0] * x[0] + x[1] * x[1]).sqrt();
            let off = ring - self.major;
            let tube = (off * off + x[2] * x[2]).sqrt();
            *found = ring > 1e-12 && tube > 1e-12;
            if *found {
                let scale = (self.major + self.minor * off / tube) / ring;
                p.copy_from_slice(&[x[0] * scale, x[1] * scale, self.minor * x[2] / tube]);
            }
        }
        Ok(())
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        for (p, basis) in points.chunks_exact(3).zip(bases.chunks_exact_mut(6)) {
            let ring = (p[0] * p[0] + p[1] * p[1]).sqrt();
            let (c, s) = (p[0] / ring, p[1] / ring);
            let (out, up) = ((ring - self.major) / self.minor, p[2] / self.minor);
            basis.copy_from_slice(&[-s, -c * up, c, -s * up, 0.0, out]);
        }
        Ok(())
    }
}

/// T^k as a product of unit circles in R^2k; for k = 2 the Clifford torus. It is flat.
#[derive(Clone, Copy, Debug)]
pub struct ProductOfCircles {
    /// How many circles.
    pub k: usize,
}

impl Oracle for ProductOfCircles {
    fn dimension(&self) -> usize {
        self.k
    }

    fn ambient_dimension(&self) -> usize {
        2 * self.k
    }

    fn concurrent(&self) -> bool {
        true
    }

    fn capabilities(&self) -> Capabilities {
        TANGENTS
    }

    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        Some((vec![-1.1; 2 * self.k], vec![1.1; 2 * self.k]))
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        for (i, (x, p)) in x.chunks_exact(2).zip(points.chunks_exact_mut(2)).enumerate() {
            let length = (x[0] * x[0] + x[1] * x[1]).sqrt();
            if length > 1e-12 {
                p.copy_from_slice(&[x[0] / length, x[1] / length]);
            } else {
                found[i / self.k] = false;
            }
        }
        Ok(())
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        for (i, p) in points.chunks_exact(2).enumerate() {
            let (row, column) = (2 * i, i % self.k);
            bases[row * self.k + column] = -p[1];
            bases[(row + 1) * self.k + column] = p[0];
        }
        Ok(())
    }
}
