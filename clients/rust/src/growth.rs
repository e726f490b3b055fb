//! The client's copy of a mesh that grows by deltas.

use crate::error::Error;
use crate::proto::{DeltaChunk, MeshDelta, Orientation, Place, Places};
use crate::rows::{bits_of, bytes_of_bits, is_set, row_at, sorted_order};
use crate::wire::{indices, numbers};
use crate::Mesh;

const UNSETTLED: usize = 300_000; // vertex numbers of removed simplices at least; else half of those there

/// Vertices and simplices as of the last complete revision. What comes and goes is put aside, and
/// settled for many revisions together. An error is a delta that does not fit what came before.
#[derive(Debug)]
pub struct GrowingComplex {
    k: usize,
    d: usize,
    revision: u64,
    coordinates: Vec<f64>,
    walls: Vec<u64>, // bits, of the vertices up to the last on a wall
    rows: Vec<u32>,  // in lexicographic order
    added: Vec<u32>,
    removed: Vec<u32>,
    pending: Vec<MeshDelta>,
    turned: Option<Vec<u8>>, // of the last revision; None: not known
    turned_rows: Vec<u32>,   // of a download
    untold: bool,            // a part of the download was not oriented
    places: Vec<String>,     // of a download of a reconstruction
    smoothed: Vec<f64>,
}

impl GrowingComplex {
    /// The empty k-complex in R^d.
    pub fn new(k: usize, d: usize) -> Self {
        let empty = Vec::new;
        GrowingComplex {
            k,
            d,
            revision: 0,
            coordinates: Vec::new(),
            walls: Vec::new(),
            rows: empty(),
            added: empty(),
            removed: empty(),
            pending: Vec::new(),
            turned: None,
            turned_rows: Vec::new(),
            untold: false,
            places: Vec::new(),
            smoothed: Vec::new(),
        }
    }

    /// Takes one chunk; true when a revision is complete with it.
    pub fn absorb(&mut self, chunk: DeltaChunk) -> Result<bool, Error> {
        let delta = chunk.delta.unwrap_or_default();
        let revision = delta.revision;
        let begun = self.pending.first().map_or(revision, |first| first.revision);
        if revision <= self.revision || begun != revision {
            return Err(Error::protocol(format!("revision {revision} is out of order")));
        }
        self.turned = None;
        self.pending.push(delta);
        if !chunk.complete {
            return Ok(false);
        }
        let whole = std::mem::take(&mut self.pending);
        for part in &whole {
            let points = numbers(part.points.as_ref(), &[-1, self.d as i64]).map_err(Error::protocol)?;
            self.add_points(part.first_vertex, &points)?;
        }
        for part in &whole {
            self.change(part)?;
        }
        self.revision = revision;
        if self.removed.len() > UNSETTLED.max(self.rows.len() / 2) {
            self.settle()?;
        }
        Ok(true)
    }

    /// Takes a chunk of the orientation, which comes after the last revision.
    pub fn orient(&mut self, chunk: Orientation) -> Result<(), Error> {
        let before = if chunk.first_simplex == 0 { Some(Vec::new()) } else { self.turned.take() };
        self.turned = None;
        if !chunk.orientable {
            return Ok(());
        }
        match before {
            Some(mut turned) if chunk.first_simplex == 8 * turned.len() as u64 => {
                turned.extend(chunk.turned);
                self.turned = Some(turned);
                Ok(())
            }
            _ => {
                let what = format!("the orientation of simplex {} is out of order", chunk.first_simplex);
                Err(Error::protocol(what))
            }
        }
    }

    /// Notes which of the simplices that `change` has just taken are turned.
    pub(crate) fn orient_part(
        &mut self,
        cells: usize,
        orientation: Option<Orientation>,
    ) -> Result<(), Error> {
        let Some(told) = orientation.filter(|told| told.orientable) else {
            self.untold |= cells > 0;
            return Ok(());
        };
        check_bits(&told.turned, cells)?;
        let width = self.k + 1;
        let rows = &self.added[self.added.len() - cells * width..];
        for (s, row) in rows.chunks_exact(width).enumerate() {
            if is_set(&told.turned, s) {
                self.turned_rows.extend_from_slice(row);
            }
        }
        Ok(())
    }

    /// The mesh at its end, with its orientation.
    pub fn finished(&mut self) -> Result<Mesh, Error> {
        let mesh = self.mesh()?;
        if let Some(turned) = &self.turned {
            check_bits(turned, mesh.simplex_count())?;
        }
        Ok(Mesh { turned: self.turned.clone(), ..mesh })
    }

    /// The mesh of a download that is complete.
    pub(crate) fn downloaded(&mut self) -> Result<Mesh, Error> {
        self.settle()?;
        if !self.untold {
            self.turned = Some(bits_of(&self.rows, &self.turned_rows, self.k + 1));
        }
        let mesh = self.finished()?;
        let count = mesh.points.len();
        let (places, smoothed) = (std::mem::take(&mut self.places), std::mem::take(&mut self.smoothed));
        Ok(Mesh {
            places: if places.len() * self.d == count { places } else { Vec::new() },
            smoothed: Some(smoothed).filter(|all| count > 0 && all.len() == count),
            ..mesh
        })
    }

    /// Notes what became of the points of a part of a download.
    pub(crate) fn add_places(&mut self, part: Option<Places>) -> Result<(), Error> {
        let Some(part) = part else { return Ok(()) };
        let names = part.codes.iter().map(|&code| match Place::try_from(i32::from(code)) {
            Ok(place) => place.as_str_name().trim_start_matches("PLACE_").to_string(),
            Err(_) => code.to_string(), // of a newer server
        });
        self.places.extend(names);
        if part.smoothed.is_some() {
            let shape = [part.codes.len() as i64, self.d as i64];
            self.smoothed.extend(numbers(part.smoothed.as_ref(), &shape).map_err(Error::protocol)?);
        }
        Ok(())
    }

    /// Drops the chunks of a revision that was cut short: it will be sent again.
    pub fn forget_pending(&mut self) {
        self.pending.clear();
    }

    /// Back to the empty mesh.
    pub fn reset(&mut self) {
        *self = GrowingComplex::new(self.k, self.d);
    }

    pub(crate) fn add_points(&mut self, first: u64, block: &[f64]) -> Result<(), Error> {
        let count = (self.coordinates.len() / self.d) as u64;
        if !block.is_empty() && first != count {
            let what = format!("a delta starts at vertex {first}, and there are {count}");
            return Err(Error::protocol(what));
        }
        self.coordinates.extend_from_slice(block);
        Ok(())
    }

    pub(crate) fn change(&mut self, delta: &MeshDelta) -> Result<(), Error> {
        let shape = [-1, self.k as i64 + 1];
        let added = indices(delta.added.as_ref(), &shape).map_err(Error::protocol)?;
        let removed = indices(delta.removed.as_ref(), &shape).map_err(Error::protocol)?;
        let count = self.coordinates.len() / self.d;
        let (on, walls) = (&delta.boundary_vertices, &delta.boundary_walls);
        if on.len() != walls.len() || on.last().is_some_and(|&last| last as usize >= count) {
            let what = format!("walls of {} vertices do not fit the {count} that there are", on.len());
            return Err(Error::protocol(what));
        }
        for (&vertex, &walls) in on.iter().zip(walls) {
            self.walls.resize(self.walls.len().max(vertex as usize + 1), 0);
            self.walls[vertex as usize] = walls;
        }
        if let Some(id) = added.iter().find(|&&id| id as usize >= count) {
            return Err(Error::protocol(format!("a simplex has vertex {id} of {count} vertices")));
        }
        self.added.extend(added);
        self.removed.extend(removed);
        Ok(())
    }

    /// Makes `mesh` cheap.
    pub fn settle(&mut self) -> Result<(), Error> {
        if self.added.is_empty() && self.removed.is_empty() {
            return Ok(());
        }
        let width = self.k + 1;
        let first_removed = ((self.rows.len() + self.added.len()) / width) as u32;
        let all = [&self.rows[..], &self.added, &self.removed].concat();
        let order = sorted_order(&all, width);
        let mut left = Vec::with_capacity(self.rows.len() + self.added.len());
        let same = |a: &u32, b: &u32| row_at(&all, width, *a) == row_at(&all, width, *b);
        for equal in order.chunk_by(same) {
            let gone = equal.iter().filter(|&&row| row >= first_removed).count();
            match (equal.len() - gone, gone) {
                (there, gone) if there == gone => {}
                (there, gone) if there == gone + 1 => left.extend(row_at(&all, width, equal[0])),
                (there, gone) if there < gone => {
                    return Err(Error::protocol("a delta removes simplices that are not there"))
                }
                _ => return Err(Error::protocol("a delta adds simplices that are there already")),
            }
        }
        self.rows = left;
        self.added.clear();
        self.removed.clear();
        Ok(())
    }

    /// The mesh as of the last complete revision.
    pub fn mesh(&mut self) -> Result<Mesh, Error> {
        self.settle()?;
        let mut walls = self.walls.clone();
        if !walls.is_empty() {
            walls.resize(self.coordinates.len() / self.d, 0);
        }
        Ok(Mesh {
            dimension: self.k,
            ambient_dimension: self.d,
            points: self.coordinates.clone(),
            simplices: self.rows.clone(),
            walls,
            turned: None,
            places: Vec::new(),
            smoothed: None,
            revision: self.revision,
            progress: None,
            report: None,
        })
    }

    /// The last complete one.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    pub(crate) fn set_revision(&mut self, revision: u64) {
        self.revision = revision;
    }
}

fn check_bits(turned: &[u8], count: usize) -> Result<(), Error> {
    if turned.len() == bytes_of_bits(count) {
        return Ok(());
    }
    Err(Error::protocol(format!("an orientation of {} bytes came for {count} simplices", turned.len())))
}
