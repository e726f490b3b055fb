//! Rows of vertex numbers, `[m, width]` one after the other, in lexicographic order.

/// The order that sorts the rows; equal rows keep theirs. One counting sort a column.
pub fn sorted_order(rows: &[u32], width: usize) -> Vec<u32> {
    let count = rows.len() / width;
    let mut order: Vec<u32> = (0..count as u32).collect();
    let mut next = vec![0; count];
    let most = rows.iter().copied().max().unwrap_or(0) as usize;
    for column in (0..width).rev() {
        let mut start = vec![0u32; most + 2];
        for id in rows.iter().skip(column).step_by(width) {
            start[*id as usize + 1] += 1;
        }
        for id in 0..most {
            start[id + 1] += start[id];
        }
        for &row in &order {
            let place = &mut start[rows[row as usize * width + column] as usize];
            next[*place as usize] = row;
            *place += 1;
        }
        std::mem::swap(&mut order, &mut next);
    }
    order
}

/// One row.
pub fn row_at(rows: &[u32], width: usize, row: u32) -> &[u32] {
    &rows[row as usize * width..(row as usize + 1) * width]
}

/// How many bytes that many bits take.
pub fn bytes_of_bits(count: usize) -> usize {
    count.div_ceil(8)
}

/// Whether bit i is set, eight in a byte, the first in the lowest.
pub fn is_set(bits: &[u8], i: usize) -> bool {
    (bits[i / 8] >> (i % 8)) & 1 == 1
}

/// By a bit which of the rows, that are in order, are among the chosen ones, in any order.
pub fn bits_of(rows: &[u32], chosen: &[u32], width: usize) -> Vec<u8> {
    let mut bits = vec![0; bytes_of_bits(rows.len() / width)];
    let order = sorted_order(chosen, width);
    let mut next = order.iter().map(|&i| row_at(chosen, width, i)).peekable();
    for (s, row) in rows.chunks_exact(width).enumerate() {
        if next.next_if_eq(&row).is_some() {
            bits[s / 8] |= 1 << (s % 8);
        }
    }
    bits
}
