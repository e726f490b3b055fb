// Obeys `stellate conform`, whose help says what each line wants.
import { readFile, writeFile } from "node:fs/promises";
import { createInterface } from "node:readline";
import { setTimeout } from "node:timers/promises";
import {
  Client,
  type Found,
  loadTxt,
  type Mesh,
  type Oracle,
  ProductOfCircles,
  reconstruct,
  StellateError,
  Torus,
  watch,
} from "../src/index.js";

const server = process.argv[2];
const client = new Client(server, { onOutage: () => {} });

/** The unit circle of the first two coordinates of R^d. */
function circle(d: number): Oracle {
  return {
    dimension: 1,
    ambientDimension: d,
    closestPoint(x, n) {
      const points = new Float64Array(x.length);
      for (let i = 0; i < n * d; i += d) {
        const length = Math.hypot(x[i], x[i + 1]);
        points.set([x[i] / length, x[i + 1] / length], i);
      }
      return points;
    },
    tangentBasis(p, n) {
      const bases = new Float64Array(p.length);
      for (let i = 0; i < n * d; i += d) bases.set([-p[i + 1], p[i]], i);
      return bases;
    },
  };
}

/** The unit sphere, which meets lines; its sizes are 1 + z / 2. */
const sphere: Oracle = {
  dimension: 2,
  ambientDimension: 3,
  closestPoint(x, n) {
    const points = new Float64Array(3 * n);
    for (let i = 0; i < 3 * n; i += 3) {
      const length = Math.hypot(x[i], x[i + 1], x[i + 2]);
      for (let a = i; a < i + 3; a++) points[a] = x[a] / length;
    }
    return points;
  },
  tangentBasis(p, n) {
    const bases = new Float64Array(6 * n);
    for (let i = 0; i < n; i++) {
      const [x, y, z] = p.subarray(3 * i, 3 * i + 3);
      const s = z < 0 ? -1 : 1;
      const [a, b] = [-1 / (s + z), (-x * y) / (s + z)];
      bases.set([1 + s * x * x * a, b, s * b, s + y * y * a, -s * x, -y], 6 * i);
    }
    return bases;
  },
  localSize: (p, n) => Float64Array.from({ length: n }, (_, i) => 1 + p[3 * i + 2] / 2),
  intersectFlat(c, bases, radii, n) {
    const [points, found] = [new Float64Array(3 * n), new Uint8Array(n)];
    for (let i = 0; i < n; i++) {
      const [a, p, b, q, e, r] = bases.subarray(6 * i, 6 * i + 6);
      const along = [b * r - e * q, e * p - a * r, a * q - b * p];
      const at = c.subarray(3 * i, 3 * i + 3);
      const middle = along.reduce((sum, u, j) => sum + u * at[j], 0);
      const root = middle * middle - at.reduce((sum, u) => sum + u * u, 0) + 1;
      const half = Math.sqrt(Math.max(root, 0));
      const step = middle > 0 ? half - middle : -half - middle;
      found[i] = root >= 0 && Math.abs(step) <= radii[i] ? 1 : 0;
      points.set(
        along.map((u, j) => at[j] + step * u),
        3 * i,
      );
    }
    return { points, found };
  },
};

/** The part of the sphere where z and y are not negative: the axes of its two walls. */
const axes = [2, 1];
const lune: Oracle = {
  dimension: 2,
  ambientDimension: 3,
  walls: 2,
  boundingBox: [
    [-1.1, -1.1, -1.1],
    [1.1, 1.1, 1.1],
  ],
  closestPoint: (x, n) => sphere.closestPoint(x, n),
  tangentBasis: (p, n) => sphere.tangentBasis?.(p, n) ?? new Float64Array(),
  async facePoint(x, n, face) {
    const flat = x.slice();
    for (const wall of face) for (let i = axes[wall]; i < 3 * n; i += 3) flat[i] = 0;
    const points = (await sphere.closestPoint(flat, n)) as Float64Array;
    const found = Uint8Array.from({ length: n }, (_, i) => (Number.isNaN(points[3 * i]) ? 0 : 1));
    return { points, found };
  },
  clearances: (p, n) =>
    Float64Array.from({ length: 2 * n }, (_, i) => p[3 * (i >> 1) + axes[i % 2]]),
  conormals(_, n, face) {
    const normals = new Float64Array(3 * n * face.length);
    for (let i = 0; i < n * face.length; i++) normals[3 * i + axes[face[i % face.length]]] = -1;
    return normals;
  },
};

class Half extends Torus {
  override closestPoint(x: Float64Array, n: number): Found {
    const answer = super.closestPoint(x, n);
    for (let i = 0; i < n; i++) answer.found[i] &= x[3 * i] < 0 ? 0 : 1;
    return answer;
  }
}

class Raises extends Torus {
  override closestPoint(): Found {
    throw new Error("on purpose");
  }
}

const slow: Oracle = {
  dimension: 2,
  ambientDimension: 3,
  closestPoint: async (x, n) => {
    await setTimeout(2000);
    return new Torus().closestPoint(x, n);
  },
  tangentBasis: (p, n) => new Torus().tangentBasis(p, n),
};

function manifold(name: string): Oracle | undefined {
  if (name.startsWith("circle:")) return circle(Number(name.slice(7)));
  const clifford = new ProductOfCircles();
  const all: Record<string, Oracle> = {
    torus: new Torus(),
    half: new Half(),
    raises: new Raises(),
  };
  return { ...all, clifford, sphere, lune, slow }[name];
}

async function create(label: string, how = ""): Promise<string> {
  const torus: Oracle = how === "walls" ? lune : new Torus();
  if (how === "seeds") {
    torus.boundingBox = undefined;
    torus.seeds = Float64Array.of(1.4, 0, 0);
  }
  const token = how.startsWith("token=") ? how.slice(6) : undefined;
  const known = new Client(server, { credentials: { token } });
  try {
    return `created ${(await known.create(torus, { epsilon: 0.5, label })).name}`;
  } finally {
    known.close();
  }
}

async function follow(name: string, path: string): Promise<string> {
  let last: Mesh | undefined;
  try {
    for await (const grown of watch(name, { server: client })) last = grown;
  } catch (error) {
    if (!(error instanceof StellateError && error.name === "Cancelled" && error.mesh)) throw error;
    last = error.mesh;
  }
  await last?.save(path);
  if (last?.walls) await writeFile(`${path}.walls`, last.walls.join("\n") + "\n");
  const report = last?.report;
  return `mesh ${last?.revision} ${report?.termination} ${report?.certificate?.level}`;
}

async function fromPoints(path: string, k: number, d: number): Promise<string> {
  const numbers = (await readFile(path, "utf8")).trim().split(/\s+/).map(Number);
  const asked = { dimension: k, ambientDimension: d, server: client };
  const { report } = await reconstruct(Float64Array.from(numbers), asked);
  return `mesh - ${report?.termination} ${report?.certificate?.level}`;
}

async function obey(command: string, what: string, more: string, last: string): Promise<string> {
  try {
    if (command === "create") return await create(what, more);
    if (command === "watch") return await follow(what, more);
    if (command === "reconstruct") return await fromPoints(what, Number(more), Number(last));
    if (command === "save") {
      await (await loadTxt(what)).save(more);
      return "saved";
    }
    const oracle = command === "serve" ? manifold(more) : undefined;
    return oracle ? `over ${await client.serve(oracle, what)}` : "unsupported";
  } catch (error) {
    if (!(error instanceof StellateError)) return `error oracle RAISED ${String(error)}`;
    return `error ${error.name} ${error.reason} ${error.message.replaceAll("\n", " ")}`;
  }
}

for await (const line of createInterface(process.stdin)) {
  const [command, what, more, last] = line.split(" ");
  console.log(await obey(command, what, more, last));
}
client.close();
