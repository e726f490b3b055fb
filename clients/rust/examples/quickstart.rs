//! Meshes a torus through an oracle of its own, and writes torus.obj and torus.txt.
//!
//! Usage: quickstart [EPSILON] [OUTPUT_DIRECTORY]; exit status 0: certified.

use std::path::PathBuf;
use std::process::ExitCode;

use stellate::{BoxError, Oracle, RunOptions};

struct Torus;

const R: f64 = 1.0;
const TUBE: f64 = 0.4;

impl Oracle for Torus {
    fn dimension(&self) -> usize {
        2
    }

    fn ambient_dimension(&self) -> usize {
        3
    }

    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        Some((vec![-1.5, -1.5, -0.5], vec![1.5, 1.5, 0.5]))
    }

    fn closest_point(&self, x: &[f64], points: &mut [f64], _found: &mut [bool]) -> Result<(), BoxError> {
        for (x, p) in x.chunks_exact(3).zip(points.chunks_exact_mut(3)) {
            let ring = x[0].hypot(x[1]);
            let tube = (ring - R).hypot(x[2]);
            let scale = (R + TUBE * (ring - R) / tube) / ring;
            p.copy_from_slice(&[x[0] * scale, x[1] * scale, TUBE * x[2] / tube]);
        }
        Ok(())
    }
}

fn main() -> Result<ExitCode, BoxError> {
    let mut arguments = std::env::args().skip(1);
    let epsilon = arguments.next().map_or(Ok(0.1), |text| text.parse())?;
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| ".".to_string()));
    let options = RunOptions { on_progress: Some(stellate::progress_bar()), ..Default::default() };
    let mesh = stellate::mesh(&Torus, epsilon, options)?;
    if let Some(report) = &mesh.report {
        print!("{}", report.text);
    }
    mesh.save(folder.join("torus.obj"))?;
    mesh.save(folder.join("torus.txt"))?;
    Ok(if mesh.certified() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
