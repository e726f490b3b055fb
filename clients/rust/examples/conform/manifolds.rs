//! The manifolds of the kit.

use std::thread::sleep;
use std::time::Duration;

use stellate::manifolds::{ProductOfCircles, Torus};
use stellate::{BoxError, Capabilities, Oracle};

/// The torus, after something was done to its answers.
pub struct Changed(fn(&[f64], &mut [bool]) -> Result<(), BoxError>);

impl Oracle for Changed {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn capabilities(&self) -> Capabilities {
        Torus::default().capabilities()
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        Torus::default().closest_point(x, points, found)?;
        self.0(x, found)
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        Torus::default().tangent_basis(points, bases)
    }
}

/// The unit circle of the first two coordinates of R^d.
struct Circle(usize);

impl Oracle for Circle {
    fn dimension(&self) -> usize {
        1
    }

    fn ambient_dimension(&self) -> usize {
        self.0
    }

    fn capabilities(&self) -> Capabilities {
        Torus::default().capabilities()
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], _found: &mut [bool]) -> Result<(), BoxError> {
        for (x, p) in x.chunks_exact(self.0).zip(points.chunks_exact_mut(self.0)) {
            let length = x[0].hypot(x[1]);
            p.fill(0.0);
            p[..2].copy_from_slice(&[x[0] / length, x[1] / length]);
        }
        Ok(())
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        for (p, basis) in points.chunks_exact(self.0).zip(bases.chunks_exact_mut(self.0)) {
            basis.fill(0.0);
            basis[..2].copy_from_slice(&[-p[1], p[0]]);
        }
        Ok(())
    }
}

/// The unit sphere, which meets lines; its sizes are 1 + z / 2.
struct Sphere;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl Oracle for Sphere {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { intersect_flat: true, tangent_basis: true, local_size: true }
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], _found: &mut [bool]) -> Result<(), BoxError> {
        for (x, p) in x.chunks_exact(3).zip(points.chunks_exact_mut(3)) {
            let length = dot(x, x).sqrt();
            p.copy_from_slice(&[x[0] / length, x[1] / length, x[2] / length]);
        }
        Ok(())
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        for (p, basis) in points.chunks_exact(3).zip(bases.chunks_exact_mut(6)) {
            let (x, y, z) = (p[0], p[1], p[2]);
            let s = 1f64.copysign(z);
            let a = -1.0 / (s + z);
            let b = x * y * a;
            basis.copy_from_slice(&[1.0 + s * x * x * a, b, s * b, s + y * y * a, -s * x, -y]);
        }
        Ok(())
    }

    fn local_size(&self, points: &[f64], sizes: &mut [f64]) -> Result<(), BoxError> {
        for (p, size) in points.chunks_exact(3).zip(sizes) {
            *size = 1.0 + p[2] / 2.0;
        }
        Ok(())
    }

    fn intersect_flat(
        &self,
        centers: &[f64],
        bases: &[f64],
        radii: &[f64],
        points: &mut [f64],
        found: &mut [bool],
    ) -> Result<(), BoxError> {
        for (i, (c, b)) in centers.chunks_exact(3).zip(bases.chunks_exact(6)).enumerate() {
            let along = [b[2] * b[5] - b[4] * b[3], b[4] * b[1] - b[0] * b[5], b[0] * b[3] - b[2] * b[1]];
            let middle = dot(&along, c);
            let root = middle * middle - dot(c, c) + 1.0;
            let step = root.max(0.0).sqrt().copysign(middle) - middle;
            found[i] = root >= 0.0 && step.abs() <= radii[i];
            for (j, u) in along.iter().enumerate() {
                points[3 * i + j] = c[j] + step * u;
            }
        }
        Ok(())
    }
}

/// The part of the sphere where z and y are not negative, its two walls.
struct Lune;

fn axis(wall: usize) -> usize {
    2 - wall
}

impl Oracle for Lune {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        Some((vec![-1.1; 3], vec![1.1; 3]))
    }

    fn capabilities(&self) -> Capabilities {
        Torus::default().capabilities()
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        Sphere.closest_point(x, points, found)
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        Sphere.tangent_basis(points, bases)
    }

    fn walls(&self) -> usize {
        2
    }

    fn face_point(
        &self,
        x: &[f64],
        face: &[u32],
        points: &mut [f64],
        found: &mut [bool],
    ) -> Result<(), BoxError> {
        let mut flat = x.to_vec();
        for (at, found) in flat.chunks_exact_mut(3).zip(found.iter_mut()) {
            face.iter().for_each(|&wall| at[axis(wall as usize)] = 0.0);
            *found = dot(at, at) > 0.0;
        }
        Sphere.closest_point(&flat, points, found)
    }

    fn clearances(&self, points: &[f64], values: &mut [f64]) -> Result<(), BoxError> {
        for (p, values) in points.chunks_exact(3).zip(values.chunks_exact_mut(2)) {
            values.copy_from_slice(&[p[axis(0)], p[axis(1)]]);
        }
        Ok(())
    }

    fn conormals(&self, _: &[f64], face: &[u32], normals: &mut [f64]) -> Result<(), BoxError> {
        for (normal, &wall) in normals.chunks_exact_mut(3).zip(face.iter().cycle()) {
            normal[axis(wall as usize)] = -1.0;
        }
        Ok(())
    }
}

/// What the kit calls `name`.
pub fn manifold(name: &str) -> Option<Box<dyn Oracle>> {
    if let Some(d) = name.strip_prefix("circle:") {
        return Some(Box::new(Circle(d.parse().ok()?)));
    }
    Some(match name {
        "torus" => Box::new(Torus::default()),
        "clifford" => Box::new(ProductOfCircles { k: 2 }),
        "sphere" => Box::new(Sphere),
        "lune" => Box::new(Lune),
        "half" => Box::new(Changed(|x, found| {
            for (x, found) in x.chunks_exact(3).zip(found) {
                *found &= x[0] >= 0.0;
            }
            Ok(())
        })),
        "raises" => Box::new(Changed(|_, _| Err("on purpose".into()))),
        "slow" => Box::new(Changed(|_, _| {
            sleep(Duration::from_secs(2));
            Ok(())
        })),
        _ => return None,
    })
}
