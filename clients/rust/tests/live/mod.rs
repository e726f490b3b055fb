//! What the tests share: servers, and how large the meshes have to be.
#![allow(dead_code)] // each test program uses some of it

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use stellate::manifolds::Torus;
use stellate::{BoxError, Capabilities, Connection, Error, Mesh, Oracle, RunOptions};

/// What tests/languages/run sets.
pub fn from_environment(name: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| panic!("tests/languages/run sets {name}"))
}

pub fn secret(name: &str) -> PathBuf {
    PathBuf::from(from_environment("STELLATE_TEST_SECRETS")).join(name)
}

/// Vertices and simplices of the torus and of the Clifford torus, as the Python client has them.
pub fn expected() -> [(usize, usize); 2] {
    let text = from_environment("STELLATE_TEST_COUNTS");
    let all: Vec<usize> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
    [(all[0], all[1]), (all[2], all[3])]
}

pub fn counts(mesh: &Mesh) -> (usize, usize) {
    (mesh.vertex_count(), mesh.simplex_count())
}

pub fn meshed(oracle: &dyn Oracle, connection: Connection) -> Result<Mesh, Error> {
    stellate::mesh(oracle, 0.1, RunOptions { connection, ..Default::default() })
}

/// A server that can be killed and started again; or one that loses replies.
pub struct RestartingServer {
    pub address: String,
    child: Child,
}

impl RestartingServer {
    pub fn start(flags: &[&str]) -> Self {
        Self::run("STELLATE_TEST_RESTARTING_SERVER", flags)
    }

    /// One behind a proxy that loses every second reply.
    pub fn lossy() -> Self {
        Self::run("STELLATE_TEST_LOSSY_SERVER", &[])
    }

    fn run(program: &str, flags: &[&str]) -> Self {
        let mut child = Command::new(from_environment(program))
            .args(flags)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut address).unwrap();
        RestartingServer { address: address.trim().to_string(), child }
    }

    pub fn restart(&mut self) {
        self.child.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
    }
}

impl Drop for RestartingServer {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

/// A torus whose answers are spoilt after a while.
pub struct Spoilt<F> {
    asked: AtomicUsize,
    spoil: F,
}

impl<F: Fn(&mut [f64]) -> Result<(), BoxError> + Sync> Spoilt<F> {
    pub fn new(spoil: F) -> Self {
        Spoilt { asked: AtomicUsize::new(0), spoil }
    }
}

impl<F: Fn(&mut [f64]) -> Result<(), BoxError> + Sync> Oracle for Spoilt<F> {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        Torus::default().bounding_box()
    }

    fn capabilities(&self) -> Capabilities {
        Torus::default().capabilities()
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        Torus::default().closest_point(x, points, found)?;
        if self.asked.fetch_add(found.len(), Ordering::Relaxed) > 300 {
            return (self.spoil)(points);
        }
        Ok(())
    }

    fn tangent_basis(&self, points: &[f64], bases: &mut [f64]) -> Result<(), BoxError> {
        Torus::default().tangent_basis(points, bases)
    }
}
