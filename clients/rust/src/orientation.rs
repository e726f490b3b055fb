//! Turning the simplices of a complex to agree with their neighbours.

use crate::rows::{row_at, sorted_order};

/// The same simplices, some with their first two vertices exchanged, so that neighbours induce opposite
/// orientations on the facet they share. None if that cannot be: the complex is not orientable, or a
/// facet is in more than two simplices. Rows have to be ascending.
pub fn orient(simplices: &[u32], width: usize) -> Option<Vec<u32>> {
    let others = facing(simplices, width)?;
    let mut turned = vec![0i8; simplices.len() / width]; // 0: not seen, 1: as it is, -1: turned
    for start in 0..turned.len() {
        if turned[start] != 0 {
            continue;
        }
        turned[start] = 1;
        let mut front = vec![start];
        while let Some(s) = front.pop() {
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
                    front.push(neighbour);
                }
            }
        }
    }
    let mut oriented = simplices.to_vec();
    for (row, _) in oriented.chunks_exact_mut(width).zip(&turned).filter(|(_, &sign)| sign < 0) {
        row.swap(0, 1);
    }
    Some(oriented)
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
