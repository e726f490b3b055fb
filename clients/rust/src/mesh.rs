//! A mesh, finished or growing.

use std::fmt::{Display, Write as _};
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::error::{Error, Kind};
use crate::proto::{Progress, Report};
use crate::rows::{is_set, row_at, sorted_order};

/// A simplicial k-complex in R^d.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// k
    pub dimension: usize,
    /// d
    pub ambient_dimension: usize,
    /// `[n, d]`, one point after the other.
    pub points: Vec<f64>,
    /// `[m, k+1]`, zero-based, ascending in each row, rows in lexicographic order.
    pub simplices: Vec<u32>,
    /// `[n]`, as bits the walls that each vertex lies on; empty without a boundary.
    pub walls: Vec<u64>,
    /// The protocol's `Orientation.turned`: see [`Mesh::oriented_simplices`].
    pub turned: Option<Vec<u8>>,
    /// What became of each point of a reconstruction, "OK" or another `Place`; empty of other meshes.
    pub places: Vec<String>,
    /// `[n, d]`, the positions that a reconstruction of noisy points was built on.
    pub smoothed: Option<Vec<f64>>,
    /// One for each round that changed the mesh.
    pub revision: u64,
    /// How it stood at this revision.
    pub progress: Option<Progress>,
    /// How it ended and what is proved; None while it grows.
    pub report: Option<Report>,
}

impl Mesh {
    /// Reads the .txt format back, to the last bit.
    pub fn load_txt(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let wrong = |what: String| Error::new(Kind::Save, "FORMAT", format!("{}: {what}", path.display()));
        let text = fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        let mut words = text.split_whitespace();
        let mut whole = || words.next().and_then(|word| word.parse::<usize>().ok());
        let head = [whole(), whole(), whole(), whole()];
        let [Some(k), Some(d), Some(vertices), Some(simplices)] = head else {
            return Err(wrong("the first line has to be \"k d nv ns\"".to_string()));
        };
        let points: Vec<f64> = words.by_ref().take(d * vertices).flat_map(str::parse).collect();
        let rows: Vec<u32> = words.flat_map(str::parse).collect();
        if points.len() != d * vertices || rows.len() != (k + 1) * simplices {
            return Err(wrong("it does not have the numbers that its first line speaks of".to_string()));
        }
        Ok(Mesh {
            dimension: k,
            ambient_dimension: d,
            points,
            simplices: rows,
            walls: Vec::new(),
            turned: None,
            places: Vec::new(),
            smoothed: None,
            revision: 0,
            progress: None,
            report: None,
        })
    }

    /// n
    pub fn vertex_count(&self) -> usize {
        self.points.len() / self.ambient_dimension
    }

    /// m
    pub fn simplex_count(&self) -> usize {
        self.simplices.len() / (self.dimension + 1)
    }

    /// Whether the mesh is finished and proved good.
    pub fn certified(&self) -> bool {
        let proved = self.report.as_ref().and_then(|report| report.certificate.as_ref());
        proved.is_some_and(|certificate| certificate.certified)
    }

    /// The (k-1)-faces that are in one simplex alone, `[m, k]`, in lexicographic order; each lies on the
    /// walls that all its vertices have in common.
    pub fn boundary(&self) -> Vec<u32> {
        let k = self.dimension;
        let mut faces = Vec::with_capacity(self.simplices.len() * k);
        for row in self.simplices.chunks_exact(k + 1) {
            for left in 0..=k {
                faces.extend_from_slice(&row[..left]);
                faces.extend_from_slice(&row[left + 1..]);
            }
        }
        let order = sorted_order(&faces, k);
        let same = |a: &u32, b: &u32| row_at(&faces, k, *a) == row_at(&faces, k, *b);
        let once = order.chunk_by(same).filter(|equal| equal.len() == 1);
        once.flat_map(|face| row_at(&faces, k, face[0])).copied().collect()
    }

    /// The simplices with the last two vertices of some exchanged so that neighbours agree, and the
    /// normals of a hypersurface point outwards. The server tells it of meshes that are over. None if the
    /// mesh is not orientable, and where that is not known: while it grows, and of a .txt file.
    pub fn oriented_simplices(&self) -> Option<Vec<u32>> {
        let turned = self.turned.as_ref()?;
        let mut oriented = self.simplices.clone();
        for (s, row) in oriented.chunks_exact_mut(self.dimension + 1).enumerate() {
            if is_set(turned, s) {
                row.swap(self.dimension - 1, self.dimension);
            }
        }
        Some(oriented)
    }

    /// Writes .txt (any k and d, exact: "k d nv ns", coordinates, ids from zero) or .obj (curves and
    /// surfaces, d <= 3, oriented as `oriented_simplices` are). `stellate download` writes the other formats.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        check_save(path, self.dimension, self.ambient_dimension)?;
        let part = path.with_extension("part"); // the file takes its name when it is whole
        let written = fs::File::create(&part).and_then(|file| {
            let mut out = BufWriter::new(file);
            if path.extension().is_some_and(|ending| ending == "txt") {
                self.write_txt(&mut out)?;
            } else {
                self.write_obj(&mut out)?;
            }
            out.flush()?;
            fs::rename(&part, path)
        });
        written.map_err(|error| Error::new(Kind::Save, "FORMAT", format!("{}: {error}", path.display())))
    }

    fn write_txt(&self, out: &mut impl Write) -> io::Result<()> {
        let (k, d) = (self.dimension, self.ambient_dimension);
        writeln!(out, "{k} {d} {} {}", self.vertex_count(), self.simplex_count())?;
        write_rows(out, "", self.points.iter().copied().map(exact), d, "")?;
        write_rows(out, "", self.simplices.iter(), k + 1, "")
    }

    fn write_obj(&self, out: &mut impl Write) -> io::Result<()> {
        let filled = if self.ambient_dimension == 2 { " 0" } else { "" };
        write_rows(out, "v ", self.points.iter().copied().map(exact), self.ambient_dimension, filled)?;
        let cells = self.oriented_simplices().unwrap_or_else(|| self.simplices.clone());
        let letter = if self.dimension == 1 { "l " } else { "f " };
        write_rows(out, letter, cells.iter().map(|id| id + 1), self.dimension + 1, "")
    }
}

/// C's %.17g: the same text from all clients, which comes back to the same double.
fn exact(value: f64) -> String {
    let scientific = format!("{value:.16e}");
    let (digits, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text.to_string(),
    };
    if (-4..17).contains(&exponent) {
        return trimmed(&format!("{value:.*}", (16 - exponent) as usize));
    }
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{}e{sign}{:02}", trimmed(digits), exponent.abs())
}

fn write_rows<T: Display>(
    out: &mut impl Write,
    before: &str,
    values: impl Iterator<Item = T>,
    width: usize,
    after: &str,
) -> io::Result<()> {
    let mut line = String::new();
    for (i, value) in values.enumerate() {
        let space = if i % width == 0 { before } else { " " };
        let _ = write!(line, "{space}{value}"); // into a string, which takes it
        if (i + 1) % width == 0 {
            writeln!(out, "{line}{after}")?;
            line.clear();
        }
    }
    Ok(())
}

/// Why a mesh of that kind cannot be saved under the name.
pub fn check_save(path: impl AsRef<Path>, k: usize, d: usize) -> Result<(), Error> {
    let path = path.as_ref();
    let message = match path.extension().and_then(|ending| ending.to_str()) {
        Some("txt") => return Ok(()),
        Some("obj") if k <= 2 && d <= 3 => return Ok(()),
        Some("obj") => ".obj holds curves and surfaces in the plane and in space: take .txt".to_string(),
        _ => format!(
            "{} has to end in .txt or .obj; \"stellate download\" writes the other formats",
            path.display()
        ),
    };
    Err(Error::new(Kind::Save, "FORMAT", message))
}
