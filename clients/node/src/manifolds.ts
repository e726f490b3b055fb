// Two manifolds with oracles in closed form.
import type { Found, Oracle } from "./oracle.js";

/** The torus of tube radius `minor` around a circle of radius `major`: k = 2, d = 3. */
export class Torus implements Oracle {
  readonly dimension = 2;
  readonly ambientDimension = 3;
  readonly boundingBox: [number[], number[]];

  constructor(
    readonly major = 1,
    readonly minor = 0.4,
  ) {
    const corner = [major + minor, major + minor, minor].map((x) => 1.1 * x);
    this.boundingBox = [corner.map((x) => -x), corner];
  }

  closestPoint(x: Float64Array, n: number): Found {
    const points = new Float64Array(3 * n);
    const found = new Uint8Array(n);
    for (let i = 0; i < 3 * n; i += 3) {
      const ring = Math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1]);
      const off = ring - this.major;
      const tube = Math.sqrt(off * off + x[i + 2] * x[i + 2]);
      if (!(ring > 1e-12 && tube > 1e-12)) continue;
      const scale = (this.major + (this.minor * off) / tube) / ring;
      points[i] = x[i] * scale;
      points[i + 1] = x[i + 1] * scale;
      points[i + 2] = (this.minor * x[i + 2]) / tube;
      found[i / 3] = 1;
    }
    return { points, found };
  }

  tangentBasis(p: Float64Array, n: number): Float64Array {
    const bases = new Float64Array(6 * n);
    for (let i = 0; i < n; i++) {
      const [x, y, z] = [p[3 * i], p[3 * i + 1], p[3 * i + 2]];
      const ring = Math.sqrt(x * x + y * y);
      const [c, s] = [x / ring, y / ring];
      const [out, up] = [(ring - this.major) / this.minor, z / this.minor];
      bases.set([-s, -c * up, c, -s * up, 0, out], 6 * i);
    }
    return bases;
  }
}

/** T^k as a product of unit circles in R^2k; for k = 2 the Clifford torus. It is flat. */
export class ProductOfCircles implements Oracle {
  readonly ambientDimension: number;
  readonly boundingBox: [Float64Array, Float64Array];

  constructor(readonly dimension = 2) {
    const d = (this.ambientDimension = 2 * dimension);
    this.boundingBox = [new Float64Array(d).fill(-1.1), new Float64Array(d).fill(1.1)];
  }

  closestPoint(x: Float64Array, n: number): Found {
    const points = new Float64Array(x.length);
    const found = new Uint8Array(n).fill(1);
    for (let i = 0; i < x.length; i += 2) {
      const length = Math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1]);
      if (!(length > 1e-12)) found[Math.floor(i / this.ambientDimension)] = 0;
      points[i] = x[i] / length;
      points[i + 1] = x[i + 1] / length;
    }
    return { points, found };
  }

  tangentBasis(p: Float64Array, n: number): Float64Array {
    const [k, d] = [this.dimension, this.ambientDimension];
    const bases = new Float64Array(n * d * k);
    for (let i = 0; i < n; i++) {
      for (let a = 0; a < k; a++) {
        bases[(i * d + 2 * a) * k + a] = -p[i * d + 2 * a + 1];
        bases[(i * d + 2 * a + 1) * k + a] = p[i * d + 2 * a];
      }
    }
    return bases;
  }
}
