import assert from "node:assert/strict";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import * as stellate from "../src/index.js";
import { cliffordCounts, torusCounts } from "./live.js";

let server: stellate.Server;
before(async () => {
  server = await stellate.Server.start();
});
after(() => server.close());

const counts = (mesh: stellate.Mesh) => [mesh.vertexCount, mesh.simplexCount];

test("a torus and a Clifford torus are those of the Python client", async () => {
  const torus = await stellate.mesh(new stellate.Torus(), { epsilon: 0.1, server });
  assert.deepEqual(counts(torus), torusCounts);
  assert(torus.certified);
  const clifford = await stellate.mesh(new stellate.ProductOfCircles(), {
    epsilon: 0.3,
    requireCertified: true,
  });
  assert.deepEqual(counts(clifford), cliffordCounts);
  assert.equal(clifford.report?.certificate?.eulerCharacteristic, 0);
});

test("intersections and sizes are answered, by several workers and an async oracle", async () => {
  const intersections: number[] = [];
  const sphere: stellate.Oracle = {
    dimension: 2,
    ambientDimension: 3,
    seeds: Float64Array.of(0, 0, 1),
    async closestPoint(x, n) {
      await Promise.resolve();
      const points = new Float64Array(x.length);
      const found = new Uint8Array(n);
      for (let i = 0; i < n; i++) {
        const length = Math.sqrt(x[3 * i] ** 2 + x[3 * i + 1] ** 2 + x[3 * i + 2] ** 2);
        found[i] = length > 1e-9 ? 1 : 0;
        for (let j = 3 * i; j < 3 * i + 3; j++) points[j] = x[j] / length;
      }
      return { points, found };
    },
    intersectFlat(centers, bases, radii, n) {
      intersections.push(n);
      const points = new Float64Array(centers.length);
      const found = new Uint8Array(n);
      for (let i = 0; i < n; i++) {
        // The flat is the line along u = t0 x t1 through c: |c + s u| = 1.
        const c = centers.subarray(3 * i, 3 * i + 3);
        const [a, b] = [0, 1].map((j) => [0, 2, 4].map((row) => bases[6 * i + row + j]));
        const u = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        const cu = c[0] * u[0] + c[1] * u[1] + c[2] * u[2];
        const root = cu * cu - (c[0] ** 2 + c[1] ** 2 + c[2] ** 2) + 1;
        if (root < 0) continue;
        const s = cu > 0 ? -cu + Math.sqrt(root) : -cu - Math.sqrt(root);
        if (Math.abs(s) > radii[i]) continue;
        found[i] = 1;
        for (let j = 0; j < 3; j++) points[3 * i + j] = c[j] + s * u[j];
      }
      return { points, found };
    },
    localSize: (_, n) => new Float64Array(n).fill(1),
  };
  const options = { epsilon: 0.3, sizeRate: 0.25, workers: 3, maxChunk: 50, server };
  const mesh = await stellate.mesh(sphere, options);
  assert(mesh.certified, mesh.report?.verdict);
  assert.equal(mesh.report?.certificate?.eulerCharacteristic, 2);
  assert(mesh.report?.certificate && mesh.report.certificate.maxCircumradius <= 0.25);
  assert(intersections.length > 0 && Math.max(...intersections) <= 50);
});

test("a growing mesh is seen at every revision, and by others", async () => {
  const client = new stellate.Client(server);
  const sizes: number[] = [];
  const phases = new Set<string>();
  let last: stellate.Mesh | undefined;
  for await (const grown of stellate.watch(new stellate.Torus(), {
    epsilon: 0.1,
    server: client,
    onProgress: (progress) => phases.add(progress.phase),
  })) {
    last = grown;
    sizes.push(grown.vertexCount);
  }
  assert(sizes.length > 5 && sizes.every((size, i) => i === 0 || size >= sizes[i - 1]));
  assert.deepEqual(last && counts(last), torusCounts);
  assert(phases.has("REFINING") && phases.has("DONE"));
  client.close();
});

test("created, served, listed, watched by name, downloaded, cancelled, deleted", async () => {
  const client = new stellate.Client(server);
  const torus = new stellate.Torus();
  const info = await client.create(torus, { epsilon: 0.1, label: "by hand", randomSeed: 7n });
  const state = stellate.serve(torus, info.name, { server, worker: "by hand" });
  let watched: stellate.Mesh | undefined;
  for await (const grown of stellate.watch(info.name, { server })) watched = grown;
  assert.equal(await state, "SUCCEEDED");
  assert.equal(await client.serve(torus, info.name), "SUCCEEDED"); // too late, and no error
  const fetched = await stellate.download(info.name, { server: client });
  assert.deepEqual(fetched.simplices, watched?.simplices);
  assert.deepEqual(fetched.points, watched?.points);
  assert(fetched.certified);
  const listed: string[] = [];
  for await (const mesh of client.list(1)) listed.push(mesh.label);
  assert(listed.includes("by hand"));
  await client.delete(info.name);
  await assert.rejects(client.get(info.name), stellate.MeshNotFound);
  client.close();
});

test("an aborted mesh is cancelled, with what there was of it", async () => {
  const controller = new AbortController();
  const onProgress = ({ vertices }: stellate.Progress) => vertices > 500 && controller.abort();
  const running = stellate.mesh(new stellate.Torus(), {
    epsilon: 0.01,
    server,
    onProgress,
    signal: controller.signal,
  });
  await assert.rejects(running, (error) => {
    assert(error instanceof stellate.Cancelled);
    return error.mesh !== undefined && error.mesh.vertexCount > 500;
  });
});

test("files: exact text, and oriented triangles", async () => {
  const folder = await mkdtemp(join(tmpdir(), "stellate-test-"));
  try {
    const path = join(folder, "torus.txt");
    const mesh = await stellate.mesh(new stellate.Torus(), { epsilon: 0.3, server, save: path });
    const words = (await readFile(path, "utf8")).trim().split(/\s+/).map(Number);
    assert.deepEqual(words.slice(0, 4), [2, 3, ...counts(mesh)]);
    assert.deepEqual(words.slice(4, 4 + mesh.points.length), [...mesh.points]);
    assert.deepEqual(words.slice(4 + mesh.points.length), [...mesh.simplices]);
    await mesh.save(join(folder, "torus.obj"));
    const directed = new Set<string>();
    for (const line of (await readFile(join(folder, "torus.obj"), "utf8")).split("\n")) {
      if (!line.startsWith("f ")) continue;
      const [a, b, c] = line.slice(2).split(" ");
      for (const edge of [`${a} ${b}`, `${b} ${c}`, `${c} ${a}`]) {
        assert(!directed.has(edge), "two triangles run along an edge the same way");
        directed.add(edge);
      }
    }
    assert.equal(directed.size, 3 * mesh.simplexCount);
    await assert.rejects(mesh.save(join(folder, "torus.vtu")), stellate.SaveError);
  } finally {
    await rm(folder, { recursive: true });
  }
});
