//! Meshes, against the real server.

mod live;

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use live::{counts, expected};
use stellate::manifolds::{ProductOfCircles, Torus};
use stellate::proto::{Criteria, Phase};
use stellate::{BoxError, Cancel, Capabilities, Client, ClientOptions, Connection, Growth, Kind};
use stellate::{MeshOptions, Oracle, RunOptions, Server, ServerOptions, WorkerOptions};

fn client() -> (Server, Client) {
    let server = Server::start(&ServerOptions::default()).unwrap();
    let client = Client::of(&server, ClientOptions::default()).unwrap();
    (server, client)
}

#[test]
fn same_meshes_as_python() {
    let [torus, clifford] = expected();
    let mesh = live::meshed(&Torus::default(), Connection::Own).unwrap();
    assert_eq!(counts(&mesh), torus);
    assert!(mesh.certified());
    let (_server, client) = client();
    let connection = Connection::Client(&client);
    let options = RunOptions { connection, require_certified: true, ..Default::default() };
    let mesh = stellate::mesh(&ProductOfCircles { k: 2 }, 0.3, options).unwrap();
    assert_eq!(counts(&mesh), clifford);
    assert_eq!(mesh.report.unwrap().certificate.unwrap().euler_characteristic, 0);
}

/// Answers everything but tangents, and has seeds instead of a box.
#[derive(Default)]
struct Sphere {
    intersections: AtomicUsize,
    most: AtomicUsize,
}

impl Oracle for Sphere {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn seeds(&self) -> Option<Vec<f64>> {
        Some(vec![0.0, 0.0, 1.0])
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { intersect_flat: true, local_size: true, ..Default::default() }
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        for ((x, p), found) in x.chunks(3).zip(points.chunks_mut(3)).zip(found) {
            let length = x.iter().map(|v| v * v).sum::<f64>().sqrt();
            *found = length > 1e-9;
            p.iter_mut().zip(x).for_each(|(p, x)| *p = x / length);
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
        self.intersections.fetch_add(found.len(), Ordering::Relaxed);
        self.most.fetch_max(found.len(), Ordering::Relaxed);
        for i in 0..found.len() {
            // The flat is the line along u = t0 x t1 through c: |c + s u| = 1.
            let (c, b) = (&centers[3 * i..3 * i + 3], &bases[6 * i..6 * i + 6]);
            let u = [b[2] * b[5] - b[4] * b[3], b[4] * b[1] - b[0] * b[5], b[0] * b[3] - b[2] * b[1]];
            let cu = c[0] * u[0] + c[1] * u[1] + c[2] * u[2];
            let root = cu * cu - c.iter().map(|v| v * v).sum::<f64>() + 1.0;
            let along = root.max(0.0).sqrt().copysign(cu) - cu;
            found[i] = root >= 0.0 && along.abs() <= radii[i];
            (0..3).for_each(|j| points[3 * i + j] = c[j] + along * u[j]);
        }
        Ok(())
    }

    fn local_size(&self, _points: &[f64], sizes: &mut [f64]) -> Result<(), BoxError> {
        sizes.fill(1.0);
        Ok(())
    }
}

#[test]
fn intersections_and_sizes_by_several_workers() {
    let (_server, client) = client();
    let oracle = Sphere::default();
    let criteria = Criteria { size_rate: Some(0.25), ..Default::default() };
    let options = RunOptions {
        connection: Connection::Client(&client),
        mesh: MeshOptions { criteria, ..Default::default() },
        workers: 3,
        max_chunk: Some(50),
        ..Default::default()
    };
    let proved = stellate::mesh(&oracle, 0.3, options).unwrap().report.unwrap().certificate.unwrap();
    assert!(proved.certified && proved.euler_characteristic == 2, "{}", proved.verdict);
    assert!(proved.max_circumradius <= 0.25);
    assert!(oracle.intersections.into_inner() > 0 && oracle.most.into_inner() <= 50);
}

#[test]
fn growing() {
    let (_server, client) = client();
    let (mut sizes, mut phases, mut last) = (Vec::new(), Vec::new(), None);
    let options = RunOptions {
        connection: Connection::Client(&client),
        on_progress: Some(Box::new(|progress| phases.push(progress.phase()))),
        ..Default::default()
    };
    stellate::watch(&Torus::default(), 0.1, options, |mesh| {
        sizes.push(mesh.vertex_count());
        last = Some(mesh);
        Growth::GoOn
    })
    .unwrap();
    assert!(sizes.len() > 5 && sizes.is_sorted(), "{sizes:?}");
    assert_eq!(counts(&last.unwrap()), expected()[0]);
    assert!(phases.contains(&Phase::Refining) && phases.contains(&Phase::Done));

    // Who leaves takes the mesh along.
    let options = RunOptions { connection: Connection::Client(&client), ..Default::default() };
    let mut seen = 0;
    stellate::watch(&Torus::default(), 0.02, options, |_| {
        seen += 1;
        Growth::Leave
    })
    .unwrap();
    assert_eq!(seen, 1);
    assert!(client.list().unwrap().is_empty());
}

#[test]
fn call_by_call() {
    let (_server, client) = client();
    let torus = Torus::default();
    let options = MeshOptions { label: "by hand".to_string(), random_seed: 7, ..Default::default() };
    let info = client.create(&torus, 0.1, &options).unwrap();
    let mut watched = None;
    let worker = WorkerOptions { worker: "by hand".to_string(), ..Default::default() };
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| client.serve(&torus, &info.name, &worker).unwrap());
        let connection = Connection::Client(&client);
        stellate::watch_by_name(&info.name, connection, |mesh| {
            watched = Some(mesh);
            Growth::GoOn
        })
        .unwrap();
        assert_eq!(serving.join().unwrap(), "SUCCEEDED");
    });
    let late = client.serve(&torus, &info.name, &WorkerOptions::default()); // and no error
    assert_eq!(late.unwrap(), "SUCCEEDED");
    let (fetched, watched) =
        (stellate::download(&info.name, 0, Connection::Client(&client)).unwrap(), watched.unwrap());
    assert_eq!((&fetched.points, &fetched.simplices), (&watched.points, &watched.simplices));
    assert!(fetched.certified());
    let listed = client.list().unwrap();
    assert!(listed.iter().any(|mesh| mesh.spec.as_ref().unwrap().label == "by hand"));
    client.delete(&info.name).unwrap();
    assert_eq!(client.get(&info.name).unwrap_err().kind, Kind::MeshNotFound);
}

#[test]
fn cancelled_with_the_mesh_so_far() {
    let (_server, client) = client();
    let cancel = Cancel::default();
    let options = RunOptions {
        connection: Connection::Client(&client),
        on_progress: Some(Box::new(|progress| {
            if progress.vertices > 500 {
                cancel.cancel();
            }
        })),
        cancel: cancel.clone(),
        ..Default::default()
    };
    let error = stellate::mesh(&Torus::default(), 0.01, options).unwrap_err();
    assert_eq!(error.kind, Kind::Cancelled);
    assert!(error.mesh.unwrap().vertex_count() > 500);
}

#[test]
fn files() {
    let (_server, client) = client();
    let options = RunOptions { connection: Connection::Client(&client), ..Default::default() };
    let mesh = stellate::mesh(&Torus::default(), 0.3, options).unwrap();
    let folder = std::env::temp_dir().join(format!("stellate-rust-files-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    mesh.save(folder.join("torus.txt")).unwrap();
    mesh.save(folder.join("torus.obj")).unwrap();
    let text = std::fs::read_to_string(folder.join("torus.txt")).unwrap();
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let (vertices, simplices) = counts(&mesh);
    assert_eq!(numbers[..4], [2.0, 3.0, vertices as f64, simplices as f64]);
    assert_eq!(numbers[4..4 + 3 * vertices], mesh.points);
    assert!(numbers[4 + 3 * vertices..].iter().zip(&mesh.simplices).all(|(a, &b)| *a == f64::from(b)));

    let mut directed = HashSet::new();
    for line in std::fs::read_to_string(folder.join("torus.obj")).unwrap().lines() {
        let Some(rest) = line.strip_prefix("f ") else { continue };
        let c: Vec<u32> = rest.split(' ').map(|word| word.parse().unwrap()).collect();
        for i in 0..3 {
            assert!(
                directed.insert((c[i], c[(i + 1) % 3])),
                "two triangles run along an edge the same way"
            );
        }
    }
    assert_eq!(directed.len(), 3 * simplices);
    assert_eq!(mesh.save(folder.join("torus.vtu")).unwrap_err().kind, Kind::Save);
    std::fs::remove_dir_all(folder).unwrap();
}
