//! What a manifold has to answer, and the checks that answers pass before they are sent.

use std::sync::Mutex;

use crate::error::{Error, Kind};
use crate::proto::{AnswerChunk, OracleCapabilities, QueryChunk, QueryKind};
use crate::wire::{numbers, to_wire};

/// Whatever an oracle fails with.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// What an oracle can do beyond `closest_point`: the methods that it overrides.
#[derive(Clone, Copy, Debug, Default)]
#[allow(missing_docs)]
pub struct Capabilities {
    pub intersect_flat: bool,
    pub tangent_basis: bool,
    pub local_size: bool,
}

/// A compact smooth k-submanifold M of R^d without boundary, 1 <= k < d, unless it has `walls`.
///
/// Methods take and fill whole batches, of `found.len()` points. The answer to a query must not depend
/// on the rest of its batch. Calls come one at a time unless the oracle is `concurrent`.
pub trait Oracle: Sync {
    /// k
    fn dimension(&self) -> usize;
    /// d
    fn ambient_dimension(&self) -> usize;

    /// Where to look for M: two corners. This or `seeds` is needed.
    fn bounding_box(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        None
    }

    /// `[m, d]`, points near M, one at least on each component.
    fn seeds(&self) -> Option<Vec<f64>> {
        None
    }

    /// Whether several workers may call it at the same time.
    fn concurrent(&self) -> bool {
        false
    }

    /// Which of the methods below it has.
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    /// Writes a point of M nearest to each x `[n, d]` to `points`, and false to `found`, which comes as
    /// true everywhere, where it has none.
    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError>;

    /// The point of M nearest to each center `[n, d]` in the flat through it that is orthogonal to the
    /// columns of its basis `[n, d, k]`, within the radius `[n]`.
    fn intersect_flat(
        &self,
        _centers: &[f64],
        _bases: &[f64],
        _radii: &[f64],
        _points: &mut [f64],
        _found: &mut [bool],
    ) -> Result<(), BoxError> {
        Err("intersect_flat is among the capabilities and not overridden".into())
    }

    /// At points `[n, d]` of M orthonormal columns `[n, d, k]` that span the tangent space.
    fn tangent_basis(&self, _points: &[f64], _bases: &mut [f64]) -> Result<(), BoxError> {
        Err("tangent_basis is among the capabilities and not overridden".into())
    }

    /// At points `[n, d]` of M how large things are: the local feature size, or any positive lengths.
    fn local_size(&self, _points: &[f64], _sizes: &mut [f64]) -> Result<(), BoxError> {
        Err("local_size is among the capabilities and not overridden".into())
    }

    /// How many walls bound M, which has a boundary then: it is where all walls are at least 0 on M^, a
    /// manifold without one, which the methods above describe; it may be R^d itself. Walls take
    /// `tangent_basis` and the three methods below.
    fn walls(&self) -> usize {
        0
    }

    /// As `closest_point`, of points of M^ where the walls of a face, ascending, are 0, whatever the
    /// others are.
    fn face_point(
        &self,
        _x: &[f64],
        _face: &[u32],
        _points: &mut [f64],
        _found: &mut [bool],
    ) -> Result<(), BoxError> {
        Err("face_point is not overridden, and there are walls".into())
    }

    /// The walls' values at points `[n, d]`, whose signs count: `[n, walls]`.
    fn clearances(&self, _points: &[f64], _values: &mut [f64]) -> Result<(), BoxError> {
        Err("clearances is not overridden, and there are walls".into())
    }

    /// At points of a face, of each of its walls the unit normal within the tangent space along which the
    /// wall's value falls: `[n, face.len(), d]`.
    fn conormals(&self, _points: &[f64], _face: &[u32], _normals: &mut [f64]) -> Result<(), BoxError> {
        Err("conormals is not overridden, and there are walls".into())
    }
}

/// An oracle as the server sees it.
pub struct Checked<'a> {
    pub oracle: &'a dyn Oracle,
    pub k: usize,
    pub d: usize,
    pub walls: usize,
    turn: Option<Mutex<()>>,
}

impl<'a> Checked<'a> {
    pub fn new(oracle: &'a dyn Oracle) -> Result<Self, Error> {
        let (k, d) = (oracle.dimension(), oracle.ambient_dimension());
        let walls = oracle.walls();
        if k < 1 || d < k || (d == k && walls == 0) {
            let needed = "1 <= k < d is needed, or k = d with walls";
            return Err(Error::invalid(format!("dimension {k} in R^{d}: {needed}")));
        }
        if walls > 0 && !oracle.capabilities().tangent_basis {
            return Err(Error::invalid("an oracle with walls needs tangent_basis"));
        }
        let turn = (!oracle.concurrent()).then(Mutex::default);
        Ok(Checked { oracle, k, d, walls, turn })
    }

    pub fn capabilities(&self) -> OracleCapabilities {
        let Capabilities { intersect_flat, tangent_basis, local_size } = self.oracle.capabilities();
        let conormals = self.walls > 0;
        OracleCapabilities { intersect_flat, tangent_basis, local_size, conormals, ..Default::default() }
    }

    /// The oracle's answers to one chunk. Errors are the oracle's, or say what is wrong with them.
    pub fn answer(&self, chunk: &QueryChunk) -> Result<AnswerChunk, Error> {
        let _turn = self.turn.as_ref().map(|turn| turn.lock());
        let (k, d) = (self.k, self.d);
        let x = numbers(chunk.points.as_ref(), &[-1, d as i64]).map_err(Error::protocol)?;
        let n = x.len() / d;
        let mut points = vec![0.0; x.len()];
        let mut found = vec![true; n];
        match chunk.kind() {
            QueryKind::ClosestPoint if !chunk.face.is_empty() => {
                let asked = self.oracle.face_point(&x, &chunk.face, &mut points, &mut found);
                asked.map_err(Error::raised)?
            }
            QueryKind::ClosestPoint => {
                self.oracle.closest_point(&x, &mut points, &mut found).map_err(Error::raised)?
            }
            QueryKind::IntersectFlat => {
                let shape = [n as i64, d as i64, k as i64];
                let bases = numbers(chunk.bases.as_ref(), &shape).map_err(Error::protocol)?;
                let radii = numbers(chunk.radii.as_ref(), &shape[..1]).map_err(Error::protocol)?;
                let asked = self.oracle.intersect_flat(&x, &bases, &radii, &mut points, &mut found);
                asked.map_err(Error::raised)?
            }
            QueryKind::Unspecified => {
                let what = format!("a question of kind {}, unknown to this client", chunk.kind);
                return Err(Error::raised(format!("the server asks {what}").into()));
            }
        }
        let rows: Vec<usize> = (0..n).filter(|&row| found[row]).collect();
        check_finite("the answer", &points, d, &rows)?;
        let some = rows.len() < n;
        let mut reply = AnswerChunk {
            lease: chunk.lease,
            points: Some(to_wire(&points, &[n, d])),
            found: if some { found.iter().map(|&one| u8::from(one)).collect() } else { Vec::new() },
            ..Default::default()
        };
        if chunk.want_tangents {
            let mut anywhere = vec![0.0; d * k];
            (0..k).for_each(|a| anywhere[a * k + a] = 1.0);
            let ask = |on: &[f64], values: &mut [f64]| self.oracle.tangent_basis(on, values);
            let bases = self.at_found("tangent_basis", &points, &rows, &anywhere, &ask)?;
            reply.tangents = Some(to_wire(&bases, &[n, d, k]));
        }
        if chunk.want_sizes {
            let ask = |on: &[f64], values: &mut [f64]| self.oracle.local_size(on, values);
            let sizes = self.at_found("local_size", &points, &rows, &[1.0], &ask)?;
            reply.sizes = Some(to_wire(&sizes, &[n]));
        }
        if chunk.want_clearances {
            let ask = |on: &[f64], values: &mut [f64]| self.oracle.clearances(on, values);
            let values = self.at_found("clearances", &points, &rows, &vec![0.0; self.walls], &ask)?;
            reply.clearances = Some(to_wire(&values, &[n, self.walls]));
        }
        if chunk.want_clearances && !chunk.face.is_empty() {
            let ask = |on: &[f64], normals: &mut [f64]| self.oracle.conormals(on, &chunk.face, normals);
            let count = chunk.face.len();
            let normals = self.at_found("conormals", &points, &rows, &vec![0.0; count * d], &ask)?;
            reply.conormals = Some(to_wire(&normals, &[n, count, d]));
        }
        Ok(reply)
    }

    /// What the oracle says of the points that were found, and `anywhere` for the others.
    fn at_found(
        &self,
        method: &str,
        points: &[f64],
        rows: &[usize],
        anywhere: &[f64],
        ask: &Ask,
    ) -> Result<Vec<f64>, Error> {
        let (n, width) = (points.len() / self.d, anywhere.len());
        let mut values = vec![0.0; rows.len() * width];
        if rows.len() == n {
            ask(points, &mut values).map_err(Error::raised)?;
        } else if !rows.is_empty() {
            let on: Vec<f64> =
                rows.iter().flat_map(|row| &points[row * self.d..(row + 1) * self.d]).copied().collect();
            ask(&on, &mut values).map_err(Error::raised)?;
        }
        let all: Vec<usize> = (0..rows.len()).collect();
        check_finite(method, &values, width, &all)?;
        if rows.len() == n {
            return Ok(values);
        }
        let mut spread = anywhere.repeat(n);
        for (row, value) in rows.iter().zip(values.chunks_exact(width)) {
            spread[row * width..(row + 1) * width].copy_from_slice(value);
        }
        Ok(spread)
    }
}

type Ask<'a> = dyn Fn(&[f64], &mut [f64]) -> Result<(), BoxError> + 'a;

fn check_finite(what: &str, values: &[f64], width: usize, rows: &[usize]) -> Result<(), Error> {
    for &row in rows {
        if let Some(value) = values[row * width..(row + 1) * width].iter().find(|v| !v.is_finite()) {
            let message = format!("{what} for point {row} of a batch is {value}");
            return Err(Error::new(Kind::Oracle, "ORACLE_NOT_FINITE", message));
        }
    }
    Ok(())
}
