//! Manifolds with boundary.

mod live;

use live::from_environment;
use stellate::manifolds::Torus;
use stellate::{download, mesh, BoxError, Capabilities, Client, ClientOptions, Connection, Kind};
use stellate::{MeshOptions, Oracle, RunOptions, Server, ServerOptions, WorkerOptions};

/// The part of the unit sphere where z is not negative.
struct Hemisphere;

impl Oracle for Hemisphere {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn walls(&self) -> usize {
        1
    }

    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        Some((vec![-1.1; 3], vec![1.1; 3]))
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { tangent_basis: true, ..Default::default() }
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], _: &mut [bool]) -> Result<(), BoxError> {
        for (x, p) in x.chunks_exact(3).zip(points.chunks_exact_mut(3)) {
            let length = (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]).sqrt();
            p.copy_from_slice(&[x[0] / length, x[1] / length, x[2] / length]);
        }
        Ok(())
    }

    fn face_point(
        &self,
        x: &[f64],
        _: &[u32],
        points: &mut [f64],
        found: &mut [bool],
    ) -> Result<(), BoxError> {
        let flat: Vec<f64> = x.chunks_exact(3).flat_map(|x| [x[0], x[1], 0.0]).collect();
        self.closest_point(&flat, points, found)
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        for (p, basis) in points.chunks_exact(3).zip(bases.chunks_exact_mut(6)) {
            let (x, y, s) = (p[0], p[1], 1f64.copysign(p[2]));
            let a = -1.0 / (s + p[2]);
            let rows = [1.0 + s * x * x * a, x * y * a, s * x * y * a, s + y * y * a, -s * x, -y];
            basis.copy_from_slice(&rows);
        }
        Ok(())
    }

    fn clearances(&self, points: &[f64], values: &mut [f64]) -> Result<(), BoxError> {
        points.chunks_exact(3).zip(values).for_each(|(p, value)| *value = p[2]);
        Ok(())
    }

    fn conormals(&self, _: &[f64], _: &[u32], normals: &mut [f64]) -> Result<(), BoxError> {
        normals.chunks_exact_mut(3).for_each(|normal| normal[2] = -1.0);
        Ok(())
    }
}

#[test]
fn manifolds_with_boundary() {
    let server = Server::start(&ServerOptions::default()).unwrap();
    let client = Client::of(&server, ClientOptions::default()).unwrap();
    let options = RunOptions { connection: Connection::Client(&client), ..Default::default() };
    let half = mesh(&Hemisphere, 0.2, options).unwrap();
    assert!(half.certified());
    let counts = format!("{} {}", half.vertex_count(), half.simplex_count());
    assert_eq!(counts, from_environment("STELLATE_TEST_HEMISPHERE"));
    assert_eq!(half.walls.len(), half.vertex_count());
    for (p, &walls) in half.points.chunks_exact(3).zip(&half.walls) {
        assert!(p[2] >= 0.0 && (p[2] == 0.0) == (walls == 1), "{p:?} {walls}");
    }
    let edges = half.boundary();
    let on = half.walls.iter().filter(|&&walls| walls == 1).count();
    assert_eq!(edges.len(), 2 * on, "a circle");
    assert!(on > 0 && edges.iter().all(|&vertex| half.walls[vertex as usize] == 1));

    let info = client.create(&Hemisphere, 0.2, &MeshOptions::default()).unwrap();
    let other = client.serve(&Torus::default(), &info.name, &WorkerOptions::default());
    assert_eq!(other.unwrap_err().kind, Kind::InvalidArgument);
    client.serve(&Hemisphere, &info.name, &WorkerOptions::default()).unwrap();
    let fetched = download(&info.name, 0, Connection::Client(&client)).unwrap();
    assert_eq!((fetched.walls, fetched.simplices), (half.walls, half.simplices));
}
