// The Clifford torus: rustc -O --edition 2021 clifford.rs
//                     stellate mesh --oracle-command ./clifford -e 0.2 -o clifford.txt
use std::io::{self, Read, Write};

fn main() -> io::Result<()> {
    let (mut input, mut output) = (io::stdin().lock(), io::stdout().lock());
    output.write_all(b"stellate-oracle 1 binary k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1\n")?;
    output.flush()?;
    let mut head = [0u8; 16];
    while input.read_exact(&mut head).is_ok() {
        let n = u32::from_ne_bytes(head[4..8].try_into().unwrap());
        let mut bytes = vec![0u8; 32 * n as usize];
        input.read_exact(&mut bytes)?;
        let (mut points, mut tangents, mut found) = (vec![], vec![], vec![]);
        for point in bytes.chunks_exact(32) {
            let at = |i: usize| f64::from_ne_bytes(point[8 * i..8 * i + 8].try_into().unwrap());
            let (a, b) = (at(0).hypot(at(1)), at(2).hypot(at(3)));
            let (x, y, z, w) = (at(0) / a, at(1) / a, at(2) / b, at(3) / b);
            points.extend([x, y, z, w].map(|v| 0.5f64.sqrt() * v));
            tangents.extend([-y, 0.0, x, 0.0, 0.0, -w, 0.0, z]);
            found.push((a * b > 0.0) as u8);
        }
        let mut answer = [n.to_ne_bytes(), 5u32.to_ne_bytes()].concat();
        answer.extend(points.iter().chain(&tangents).flat_map(|v: &f64| v.to_ne_bytes()));
        answer.extend(found);
        output.write_all(&answer)?;
        output.flush()?;
    }
    Ok(())
}
