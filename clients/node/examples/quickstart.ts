// Meshes a torus through an oracle of its own, and writes torus.obj and torus.txt.
//
// Usage: node dist/examples/quickstart.js [EPSILON] [OUTPUT_DIRECTORY]
import { join } from "node:path";
import { mesh, type Oracle, progressBar } from "../src/index.js";

const [R, r] = [1, 0.4];

const torus: Oracle = {
  dimension: 2,
  ambientDimension: 3,
  boundingBox: [
    [-1.5, -1.5, -0.5],
    [1.5, 1.5, 0.5],
  ],
  closestPoint(x, n) {
    const p = new Float64Array(3 * n);
    for (let i = 0; i < 3 * n; i += 3) {
      const ring = Math.hypot(x[i], x[i + 1]);
      const tube = Math.hypot(ring - R, x[i + 2]);
      const scale = (R + (r * (ring - R)) / tube) / ring;
      p.set([x[i] * scale, x[i + 1] * scale, (r * x[i + 2]) / tube], i);
    }
    return p;
  },
};

const [epsilon = "0.1", folder = "."] = process.argv.slice(2);
const result = await mesh(torus, { epsilon: Number(epsilon), onProgress: progressBar() });
if (result.report) console.log(result.report.text);
await result.save(join(folder, "torus.obj"));
await result.save(join(folder, "torus.txt"));
process.exitCode = result.certified ? 0 : 1;
