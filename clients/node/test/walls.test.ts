import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import * as stellate from "../src/index.js";
import { fromEnvironment } from "./live.js";

let server: stellate.Server;
before(async () => {
  server = await stellate.Server.start();
});
after(() => server.close());

/** The nearest points of the unit sphere, in space or in the plane z = 0. */
function normalised(x: Float64Array, height: number): Float64Array {
  const points = new Float64Array(x.length);
  for (let i = 0; i < x.length; i += 3) {
    const z = height * x[i + 2];
    const length = Math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1] + z * z);
    points.set([x[i] / length, x[i + 1] / length, z / length], i);
  }
  return points;
}

/** The part of the unit sphere where z is not negative. */
const hemisphere: stellate.Oracle = {
  dimension: 2,
  ambientDimension: 3,
  walls: 1,
  boundingBox: [
    [-1.1, -1.1, -1.1],
    [1.1, 1.1, 1.1],
  ],
  closestPoint: (x) => normalised(x, 1),
  facePoint: (x) => normalised(x, 0),
  tangentBasis(p, n) {
    const bases = new Float64Array(6 * n);
    for (let i = 0; i < n; i++) {
      const [x, y, z] = p.subarray(3 * i, 3 * i + 3);
      const s = z < 0 || Object.is(z, -0) ? -1 : 1;
      const a = -1 / (s + z);
      const rows = [1 + s * x * x * a, x * y * a, s * x * y * a, s + y * y * a, -s * x, -y];
      bases.set(rows, 6 * i);
    }
    return bases;
  },
  clearances: (points) => points.filter((_, i) => i % 3 === 2),
  conormals: (points) => points.map((_, i) => (i % 3 === 2 ? -1 : 0)),
};

test("a manifold with boundary is that of the Python client, and its boundary a circle", async () => {
  const mesh = await stellate.mesh(hemisphere, { epsilon: 0.2, server });
  assert(mesh.certified);
  const counts = `${mesh.vertexCount} ${mesh.simplexCount}`;
  assert.equal(counts, fromEnvironment("STELLATE_TEST_HEMISPHERE"));
  assert.equal(mesh.walls?.length, mesh.vertexCount);
  mesh.walls.forEach((walls, vertex) => {
    const z = mesh.points[3 * vertex + 2];
    assert(z >= 0 && (z === 0) === (walls === 1n), `${vertex}: ${z}, ${walls}`);
  });
  const edges = mesh.boundary();
  const on = mesh.walls.filter((walls) => walls === 1n).length;
  assert(on > 0 && edges.length === 2 * on);
  assert(edges.every((vertex) => mesh.walls?.[vertex] === 1n));

  const client = new stellate.Client(server);
  const { name } = await client.create(hemisphere, { epsilon: 0.2 });
  await assert.rejects(client.serve(new stellate.Torus(), name), stellate.InvalidArgument);
  assert.equal(await client.serve(hemisphere, name), "SUCCEEDED");
  const fetched = await stellate.download(name, { server });
  assert.deepEqual(fetched.walls, mesh.walls);
  client.close();
  const bare = { ...hemisphere, conormals: undefined };
  await assert.rejects(stellate.mesh(bare, { epsilon: 0.2, server }), /lacks conormals/);
});
