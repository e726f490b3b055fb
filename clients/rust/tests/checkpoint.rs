//! Meshes that outlive their programs.

mod live;

use std::fs;
use std::os::unix::fs::{symlink, PermissionsExt};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use live::{counts, expected, Spoilt};
use stellate::manifolds::Torus;
use stellate::{mesh, BoxError, Cancel, Capabilities, Connection, Error, Kind, Mesh, Oracle, RunOptions};

/// The torus, and how often it was asked.
#[derive(Default)]
struct Counting(AtomicUsize, Torus);

impl Oracle for Counting {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        self.1.bounding_box()
    }

    fn capabilities(&self) -> Capabilities {
        self.1.capabilities()
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        self.0.fetch_add(found.len(), Ordering::Relaxed);
        self.1.closest_point(x, points, found)
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        self.1.tangent_basis(points, bases)
    }
}

fn kept(oracle: &dyn Oracle, epsilon: f64, folder: &Path) -> Result<Mesh, Error> {
    let checkpoint = Some(folder.to_path_buf());
    mesh(oracle, epsilon, RunOptions { checkpoint, ..Default::default() })
}

#[test]
fn goes_on() {
    let folder = std::env::temp_dir().join(format!("stellate-test-{}", std::process::id()));
    let cancel = Cancel::default();
    let [first, second, third] = <[Counting; 3]>::default();
    let options = RunOptions {
        checkpoint: Some(folder.clone()),
        on_progress: Some(Box::new(|progress| {
            if progress.vertices > 500 {
                cancel.cancel();
            }
        })),
        cancel: cancel.clone(),
        ..Default::default()
    };
    let error = mesh(&first, 0.05, options).unwrap_err();
    assert_eq!(error.kind, Kind::Cancelled);
    assert!(error.message.contains("the same call goes on from there"), "{error}");
    assert!(error.mesh.is_some_and(|mesh| mesh.vertex_count() > 0));

    let whole = kept(&second, 0.05, &folder).unwrap();
    let straight = mesh(&Torus::default(), 0.05, RunOptions::default()).unwrap();
    assert_eq!((&whole.points, &whole.simplices), (&straight.points, &straight.simplices));
    let queries = straight.report.and_then(|report| report.counts).unwrap().queries;
    assert!(first.0.into_inner() > 0 && (second.0.into_inner() as u64) < queries);

    // The record of another language's client: it chose epsilon, says why, and writes out an empty label.
    let record = fs::read(folder.join("mesh")).unwrap();
    let end = record.iter().position(|&byte| byte == b'\n').unwrap();
    let theirs = [&record[..end], b" 2 a quarter of the reach", &record[end..], b"R\0"].concat();
    fs::write(folder.join("mesh"), theirs).unwrap();
    let again = kept(&third, 0.05, &folder).unwrap();
    assert!(again.certified());
    assert_eq!((third.0.into_inner(), counts(&again)), (0, counts(&whole)));
    let other = kept(&Torus::default(), 0.06, &folder).unwrap_err();
    assert_eq!(other.kind, Kind::InvalidArgument);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn waits_for_a_better_oracle() {
    let folder = std::env::temp_dir().join(format!("stellate-test-{}-better", std::process::id()));
    let raises = Spoilt::new(|_: &mut [f64]| Err("no such surface".into()));
    let error = kept(&raises, 0.1, &folder).unwrap_err();
    assert_eq!((error.kind, &error.message[..]), (Kind::Raised, "no such surface"));
    let mesh = kept(&Torus::default(), 0.1, &folder).unwrap();
    assert_eq!(counts(&mesh), expected()[0]);
    let elsewhere = RunOptions {
        checkpoint: Some(folder.clone()),
        connection: Connection::Server("localhost:1", Default::default()),
        ..Default::default()
    };
    let error = stellate::mesh(&Torus::default(), 0.1, elsewhere).unwrap_err();
    assert_eq!(error.kind, Kind::InvalidArgument);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn believes_nobody_else() {
    let base = std::env::temp_dir().join(format!("stellate-test-{}-planted", std::process::id()));
    let refused = |folder: &Path, words: &str| {
        let error = kept(&Torus::default(), 0.3, folder).unwrap_err();
        assert_eq!(error.kind, Kind::InvalidArgument);
        assert!(error.message.contains(words), "{error}");
    };
    let (open, link, planted) = (base.join("open"), base.join("link"), base.join("planted"));
    fs::create_dir_all(&open).unwrap();
    fs::set_permissions(&open, fs::Permissions::from_mode(0o777)).unwrap();
    refused(&open, "chmod go-w");
    symlink(&base, &link).unwrap();
    refused(&link, "is a link");
    refused(&link.join(""), "is a link");

    let precious = base.join("precious");
    fs::write(&precious, "mine").unwrap();
    fs::create_dir(&planted).unwrap();
    fs::set_permissions(&planted, fs::Permissions::from_mode(0o700)).unwrap();
    symlink(&precious, planted.join("mesh.new")).unwrap();
    kept(&Torus::default(), 0.3, &planted).unwrap();
    assert_eq!(fs::read_to_string(&precious).unwrap(), "mine");
    fs::rename(planted.join("mesh"), base.join("elsewhere")).unwrap();
    symlink(base.join("elsewhere"), planted.join("mesh")).unwrap();
    refused(&planted, "is a link");
    fs::remove_dir_all(base).unwrap();
}
