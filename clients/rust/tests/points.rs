//! Reconstruction from points, against the real server.

mod live;

use std::f64::consts::PI;

use live::RestartingServer;
use stellate::proto::{CertificateLevel, Reconstruction};
use stellate::{reconstruct, Cancel, Client, ClientOptions, Connection, Kind, PointCloud};
use stellate::{ReconstructOptions, Server, ServerOptions};

/// n points of the unit sphere down to a height, evenly; -1: all of it.
fn sphere(n: usize, lowest: f64) -> Vec<f64> {
    let point = |i: usize| {
        let z = 1.0 - (1.0 - lowest) * (i as f64 + 0.5) / n as f64;
        let turn = i as f64 * PI * (3.0 - 5f64.sqrt());
        let around = (1.0 - z * z).sqrt();
        [around * turn.cos(), around * turn.sin(), z]
    };
    (0..n).flat_map(point).collect()
}

fn cloud(points: &[f64]) -> PointCloud<'_> {
    PointCloud { dimension: 2, ambient_dimension: 3, points, tangents: None }
}

fn exact(client: &Client) -> ReconstructOptions<'_> {
    ReconstructOptions {
        connection: Connection::Client(client),
        spec: Reconstruction { noise: Some(0.0), ..Default::default() },
        ..Default::default()
    }
}

fn served() -> (Server, Client) {
    let server = Server::start(&ServerOptions::default()).unwrap();
    let client = Client::of(&server, ClientOptions::default()).unwrap();
    (server, client)
}

#[test]
fn a_sphere_through_one_server_or_its_own() {
    let (_server, client) = served();
    let points = sphere(600, -1.0);
    let mut heard = 0;
    let mut options = exact(&client);
    options.require_certified = true;
    options.on_progress = Some(Box::new(|_| heard += 1));
    let mesh = reconstruct(cloud(&points), options).unwrap();
    assert_eq!((&mesh.points, mesh.simplex_count()), (&points, 2 * 600 - 4));
    assert!(mesh.oriented_simplices().is_some() && mesh.smoothed.is_none() && heard > 0);
    assert_eq!(mesh.places, vec!["OK"; 600]);
    let own = ReconstructOptions { connection: Connection::Own, ..exact(&client) };
    assert_eq!(reconstruct(cloud(&points), own).unwrap().simplices, mesh.simplices);
    assert!(client.list().unwrap().is_empty());
}

#[test]
fn tangent_spaces_and_a_reach_are_a_proof() {
    let (_server, client) = served();
    let points = sphere(2500, -1.0);
    let basis = |p: &[f64]| {
        let around = p[0].hypot(p[1]);
        let (x, y, z) = (p[0] / around, p[1] / around, p[2]);
        [-y, -z * x, x, -z * y, 0.0, around]
    };
    let tangents: Vec<f64> = points.chunks(3).flat_map(basis).collect();
    let mut options = exact(&client);
    options.spec.declared_reach = Some(1.0);
    let cloud = PointCloud { tangents: Some(&tangents), ..cloud(&points) };
    let certificate = reconstruct(cloud, options).unwrap().report.unwrap().certificate.unwrap();
    assert_eq!(certificate.level(), CertificateLevel::Proved, "{}", certificate.verdict);
}

#[test]
fn where_the_sample_ends_and_noise() {
    let (_server, client) = served();
    let cap = sphere(600, -0.2);
    let mesh = reconstruct(cloud(&cap), exact(&client)).unwrap();
    assert!(!mesh.certified() && mesh.places.iter().any(|place| place == "EDGE"));
    let mut open = exact(&client);
    open.spec.open = true;
    assert!(!reconstruct(cloud(&cap), open).unwrap().boundary().is_empty());
    let strict = ReconstructOptions { require_certified: true, ..exact(&client) };
    let error = reconstruct(cloud(&cap), strict).unwrap_err();
    assert_eq!((error.kind, error.mesh.unwrap().vertex_count()), (Kind::NotCertified, 600));
    let shaken: Vec<f64> =
        sphere(900, -1.0).iter().enumerate().map(|(i, x)| x + 0.01 * (12.9898 * i as f64).sin()).collect();
    let mut options = exact(&client);
    options.spec.noise = None;
    let noisy = reconstruct(cloud(&shaken), options).unwrap();
    assert_eq!((&noisy.points, noisy.smoothed.unwrap().len()), (&shaken, shaken.len()));
}

#[test]
fn what_cannot_be_taken() {
    let (_server, client) = served();
    let points = sphere(50, -1.0);
    let mut broken = points.clone();
    broken[7] = f64::NAN;
    for (words, cloud) in [
        ("no whole points of R^3", cloud(&points[1..])),
        ("point 2 is not finite", cloud(&broken)),
        ("need 300", PointCloud { tangents: Some(&points[..3]), ..cloud(&points) }),
        ("from 1 on", PointCloud { dimension: 0, ..cloud(&points) }),
        ("k must be less than d", PointCloud { dimension: 3, ..cloud(&points) }),
        ("needs 4 at least", cloud(&points[..9])),
    ] {
        let error = reconstruct(cloud, exact(&client)).unwrap_err();
        assert!(error.kind == Kind::InvalidArgument && error.message.contains(words), "{words}: {error:?}");
    }
    let cancel = Cancel::default();
    let leaving = cancel.clone();
    let mut options = ReconstructOptions { cancel, ..exact(&client) };
    options.on_progress = Some(Box::new(move |_| leaving.cancel()));
    let error = reconstruct(cloud(&sphere(20_000, -1.0)), options).unwrap_err();
    assert_eq!(error.kind, Kind::Cancelled);
    assert!(client.list().unwrap().is_empty());
}

#[test]
fn an_upload_goes_on_after_a_kill() {
    let mut server = RestartingServer::start(&[]);
    let quiet = ClientOptions { on_outage: Box::new(|_| {}), ..Default::default() };
    let client = Client::new(&server.address, quiet).unwrap();
    let points = sphere(40_000, -1.0);
    let mut killed = false;
    let mut options = exact(&client);
    options.on_progress = Some(Box::new(|_| {
        if !std::mem::replace(&mut killed, true) {
            server.restart();
        }
    }));
    let mesh = reconstruct(cloud(&points), options).unwrap();
    assert_eq!((&mesh.points, mesh.simplex_count()), (&points, 2 * 40_000 - 4));
    assert!(killed);
}
