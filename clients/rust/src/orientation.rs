//! Turning the simplices of a complex to agree with their neighbours.

use crate::rows::{row_at, sorted_order};

/// The same simplices, some with their last two vertices exchanged, so that neighbours induce opposite
/// orientations on the facet they share; the first of each component stays, but that those of a
/// hypersurface are turned as a whole where their normals point inwards. None if that cannot be: the
/// complex is not orientable, or a facet is in more than two simplices. Rows have to be ascending.
pub fn orient(simplices: &[u32], width: usize, points: &[f64], d: usize) -> Option<Vec<u32>> {
    let others = facing(simplices, width)?;
    let mut oriented = simplices.to_vec();
    let mut turned = vec![0i8; simplices.len() / width]; // 0: not seen, 1: as it is, -1: turned
    for start in 0..turned.len() {
        if turned[start] != 0 {
            continue;
        }
        turned[start] = 1;
        let mut component = vec![start];
        let mut at = 0;
        while at < component.len() {
            let s = component[at];
            at += 1;
            for i in 0..width {
                let Some(facet) = others[s * width + i] else { continue };
                let neighbour = facet / width;
                // Facets without vertices of like parity have like orientations.
                let alike = i % 2 == facet % width % 2;
                let wanted = if alike { -turned[s] } else { turned[s] };
                if turned[neighbour] == -wanted {
                    return None;
                }
                if turned[neighbour] == 0 {
                    turned[neighbour] = wanted;
                    component.push(neighbour);
                }
            }
        }
        let mut volume = 0.0; // (k+1)! times those of the cones from the origin
        for &s in &component {
            let row = &mut oriented[s * width..(s + 1) * width];
            if turned[s] < 0 {
                row.swap(width - 2, width - 1);
            }
            if width == d {
                let corner = |&id: &u32| points[id as usize * d..(id as usize + 1) * d].to_vec();
                volume += determinant(&row.iter().map(corner).collect::<Vec<_>>());
            }
        }
        if volume < 0.0 {
            component.iter().for_each(|s| oriented.swap((s + 1) * width - 2, (s + 1) * width - 1));
        }
    }
    Some(oriented)
}

fn determinant(rows: &[Vec<f64>]) -> f64 {
    if let [row] = rows {
        return row[0];
    }
    let term = |i: usize| {
        let others = rows.iter().enumerate().filter(|(j, _)| *j != i);
        let minor: Vec<Vec<f64>> = others.map(|(_, row)| row[1..].to_vec()).collect();
        rows[i][0] * determinant(&minor) * if i.is_multiple_of(2) { 1.0 } else { -1.0 }
    };
    (0..rows.len()).map(term).sum()
}

/// For each facet the equal one of another simplex: facet f is that of simplex f / width without its
/// vertex f % width. None if three are equal.
fn facing(simplices: &[u32], width: usize) -> Option<Vec<Option<usize>>> {
    let mut facets = Vec::with_capacity(simplices.len() * (width - 1));
    for row in simplices.chunks_exact(width) {
        for left in 0..width {
            facets.extend_from_slice(&row[..left]);
            facets.extend_from_slice(&row[left + 1..]);
        }
    }
    let mut others = vec![None; simplices.len()];
    for pair in sorted_order(&facets, width - 1).windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if row_at(&facets, width - 1, a) != row_at(&facets, width - 1, b) {
            continue;
        }
        if others[a as usize].is_some() {
            return None;
        }
        others[a as usize] = Some(b as usize);
        others[b as usize] = Some(a as usize);
    }
    Some(others)
}
