// A torus: rustc -O --edition 2021 torus.rs
//          stellate mesh --oracle-command ./torus -e 0.1 -o torus.obj
use std::io::{self, Read, Write};

fn main() -> io::Result<()> {
    let (mut input, mut output) = (io::stdin().lock(), io::stdout().lock());
    output.write_all(b"stellate-oracle 1 binary k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5\n")?;
    output.flush()?;
    let mut head = [0u8; 16];
    while input.read_exact(&mut head).is_ok() {
        let n = u32::from_ne_bytes(head[4..8].try_into().unwrap());
        let mut bytes = vec![0u8; 24 * n as usize];
        input.read_exact(&mut bytes)?;
        let (mut points, mut tangents, mut found) = (vec![], vec![], vec![]);
        for point in bytes.chunks_exact(24) {
            let at = |i: usize| f64::from_ne_bytes(point[8 * i..8 * i + 8].try_into().unwrap());
            let (x, y, z) = (at(0), at(1), at(2));
            let rho = x.hypot(y);
            let q = (rho - 1.0).hypot(z);
            let (c, s, o, u) = (x / rho, y / rho, (rho - 1.0) / q, z / q);
            points.extend([(1.0 + 0.4 * o) * c, (1.0 + 0.4 * o) * s, 0.4 * u]);
            tangents.extend([-s, -u * c, c, -u * s, 0.0, o]); // row by row of a 3 x 2 matrix
            found.push((rho * q > 0.0) as u8);
        }
        let mut answer = [n.to_ne_bytes(), 5u32.to_ne_bytes()].concat(); // 1 + 4: tangents, found
        answer.extend(points.iter().chain(&tangents).flat_map(|v: &f64| v.to_ne_bytes()));
        answer.extend(found);
        output.write_all(&answer)?;
        output.flush()?;
    }
    Ok(())
}
