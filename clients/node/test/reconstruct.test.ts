import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import * as stellate from "../src/index.js";
import { CheckedPoints } from "../src/upload.js";
import { RestartingServer } from "./live.js";

let server: stellate.Server;
before(async () => {
  server = await stellate.Server.start();
});
after(() => server.close());

/** n points of the unit sphere down to a height, evenly; -1: all of it. */
function sphere(n: number, lowest = -1): Float64Array {
  const points = new Float64Array(3 * n);
  for (let i = 0; i < n; i++) {
    const z = 1 - ((1 - lowest) * (i + 0.5)) / n;
    const turn = i * Math.PI * (3 - Math.sqrt(5));
    const around = Math.sqrt(1 - z * z);
    points.set([around * Math.cos(turn), around * Math.sin(turn), z], 3 * i);
  }
  return points;
}

const asked = { dimension: 2, ambientDimension: 3 };

test("a sphere is certified, its vertices the points, through one server or its own", async () => {
  const points = sphere(600);
  const phases: string[] = [];
  const mesh = await stellate.reconstruct(points, {
    ...asked,
    noise: 0,
    server,
    requireCertified: true,
    onProgress: ({ phase }) => phases.push(phase),
  });
  assert.deepEqual(mesh.points, points);
  assert.equal(mesh.simplexCount, 2 * 600 - 4);
  assert.equal(mesh.report?.certificate?.eulerCharacteristic, 2);
  assert.ok(mesh.orientedSimplices());
  assert.deepEqual(new Set(mesh.places), new Set(["OK"]));
  assert.equal(mesh.smoothed, undefined);
  assert.ok(phases.length > 0);
  const again = await stellate.reconstruct(points, { ...asked, noise: 0 });
  assert.deepEqual(again.simplices, mesh.simplices);
  const client = new stellate.Client(server);
  for await (const left of client.list()) assert.fail(`${left.name} is left behind`);
  client.close();
});

test("weights alone make a mesh, and other words for them are refused", async () => {
  const options = { ...asked, noise: 0, steiner: true, weights: "only" } as const;
  const mesh = await stellate.reconstruct(sphere(600), {
    ...options,
    server,
    requireCertified: true,
  });
  assert.equal(mesh.simplexCount, 2 * 600 - 4);
  const { spec } = new CheckedPoints(sphere(600), options);
  assert.equal(spec.weights, "WEIGHTING_ONLY");
  assert.equal(spec.steiner, true);
  const other = "toString" as "only";
  await assert.rejects(
    () => stellate.reconstruct(sphere(600), { ...asked, weights: other }),
    /weights has to be "auto" or "only"/,
  );
});

test("tangent spaces go with the points, and proofs follow from a reach", async () => {
  const points = sphere(2500);
  const tangents = new Float64Array(2 * points.length);
  for (let i = 0; i < 2500; i++) {
    const [x, y, z] = points.subarray(3 * i, 3 * i + 3);
    const around = Math.hypot(x, y);
    const [u, v] = [
      [-y / around, x / around, 0],
      [(-z * x) / around, (-z * y) / around, around],
    ];
    for (let j = 0; j < 3; j++) tangents.set([u[j], v[j]], 6 * i + 2 * j);
  }
  const mesh = await stellate.reconstruct(points, {
    ...asked,
    tangents,
    noise: 0,
    reach: 1,
    server,
  });
  assert.equal(mesh.report?.certificate?.level, "PROVED", mesh.report?.verdict);
});

test("places name where the sample ends, and noise moves the complex", async () => {
  const cap = await stellate.reconstruct(sphere(600, -0.2), { ...asked, noise: 0, server });
  assert.ok(!cap.certified);
  assert.ok(cap.places?.includes("EDGE"), cap.report?.verdict);
  const shaken = sphere(900).map((x, i) => x + 0.01 * Math.sin(12.9898 * i));
  const noisy = await stellate.reconstruct(shaken, { ...asked, server });
  assert.equal(noisy.smoothed?.length, shaken.length);
  assert.deepEqual(noisy.points, shaken);
});

test("what cannot be taken is refused, by us or by the server", async () => {
  const refused = (points: Float64Array, more: object, words: RegExp) =>
    assert.rejects(stellate.reconstruct(points, { ...asked, server, ...more }), (error) => {
      assert.ok(error instanceof stellate.InvalidArgument, String(error));
      assert.match(error.message, words);
      return true;
    });
  const points = sphere(50);
  await refused(points.subarray(1), {}, /no whole points of R\^3/);
  await refused(
    Float64Array.from(points, (x, i) => (i === 7 ? NaN : x)),
    {},
    /point 2 is not finite/,
  );
  await refused(points, { tangents: new Float64Array(3) }, /need 300/);
  await refused(points, { epsilon: 0.1 }, /no option 'epsilon'/);
  await refused(points, { dimension: 3 }, /k must be less than d/);
  await refused(points.subarray(0, 9), {}, /needs 4 at least/);
});

test("an abort cancels, and a server that is killed goes on with what it has", async () => {
  const gone = AbortSignal.abort();
  await assert.rejects(stellate.reconstruct(sphere(100), { ...asked, server, signal: gone }));
  const mortal = await RestartingServer.start();
  try {
    const client = new stellate.Client(mortal.address, { onOutage: () => {} });
    const checked = new CheckedPoints(sphere(40_000), { ...asked, noise: 0 });
    const info = await client.declarePoints(checked);
    mortal.restart();
    await client.upload(info.name, checked, new AbortController().signal);
    mortal.restart();
    let vertices = 0;
    for await (const event of client.watch(info.name, 0, true)) {
      if (event.final) vertices = event.final.progress?.vertices ?? 0;
    }
    assert.equal(vertices, 40_000);
    client.close();
  } finally {
    await mortal.close();
  }
});
