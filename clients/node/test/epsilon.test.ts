import assert from "node:assert/strict";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import * as stellate from "../src/index.js";
import { finer } from "../src/epsilon.js";

test("what a mesh is followed by is what its report says, so often", () => {
  const said = { finer: { epsilon: 0.05, reason: "so" } } as stellate.Report;
  assert.deepEqual(finer({ epsilon: 0.1, reason: "", retries: 2 }, said), {
    ...said.finer,
    retries: 1,
  });
  assert.equal(finer({ epsilon: 0.1, reason: "", retries: 0 }, said), undefined);
  assert.equal(finer({ epsilon: 0.1, reason: "", retries: 2 }, {} as stellate.Report), undefined);
});

/** The unit circle, and a small one beside it that few questions of the doctor fall upon. */
class TwoCircles implements stellate.Oracle {
  readonly dimension = 1;
  readonly ambientDimension = 2;
  readonly boundingBox: stellate.Oracle["boundingBox"] = [
    [-1.1, -1.1],
    [1.2, 1.1],
  ];
  readonly seeds = Float64Array.of(-1, 0, 1.05, 0.01);
  asked = 0;

  closestPoint(x: Float64Array, n: number): Float64Array {
    this.asked += n;
    const points = new Float64Array(2 * n);
    for (let i = 0; i < 2 * n; i += 2) {
      const away = Math.sqrt(x[i] * x[i] + x[i + 1] * x[i + 1]);
      const across = x[i] - 1.05;
      const beside = Math.sqrt(across * across + x[i + 1] * x[i + 1]);
      const large = Math.abs(away - 1) <= Math.abs(beside - 0.01);
      const [from, scale] = large ? [0, 1 / away] : [1.05, 0.01 / beside];
      points.set([from + scale * (x[i] - from), scale * x[i + 1]], i);
    }
    return points;
  }
}

test("auto goes on where it was too coarse, and a checkpoint knows of it", async () => {
  const checkpoint = await mkdtemp(join(tmpdir(), "stellate-test-"));
  try {
    const told: [number, string][] = [];
    const onEpsilon = (epsilon: number, reason: string) => told.push([epsilon, reason]);
    const ends: stellate.Mesh[] = [];
    const options = { epsilon: "auto", checkpoint, onEpsilon } as const;
    const aborting = new AbortController();
    const { signal } = aborting;
    const onProgress = () => told.length === 2 && aborting.abort();
    await assert.rejects(
      async () => {
        const watched = stellate.watch(new TwoCircles(), { ...options, signal, onProgress });
        for await (const grown of watched) if (grown.report) ends.push(grown);
      },
      (error) => error instanceof stellate.Cancelled && /goes on from there/.test(error.message),
    );
    assert.equal(ends.length, 1);
    assert(ends[0].report && !ends[0].certified && ends[0].report.epsilon === told[0][0]);
    assert.deepEqual(told[1], Object.values(ends[0].report.finer ?? {}));

    const second = new TwoCircles();
    const mesh = await stellate.mesh(second, options);
    assert.deepEqual(told[2], told[1]);
    assert(mesh.certified, mesh.report?.verdict);
    assert.equal(mesh.report?.certificate?.components, 2);
    assert.deepEqual([mesh.report.epsilon, mesh.report.epsilonReason], told.at(-1));
    const third = new TwoCircles();
    const again = await stellate.mesh(third, options);
    assert.equal(third.asked, 0);
    assert.deepEqual(again.points, mesh.points);
    const straight = await stellate.mesh(third, { epsilon: mesh.report.epsilon });
    assert.deepEqual(straight.points, mesh.points);
    assert(second.asked <= third.asked); // nobody examined it
    assert.equal(straight.report?.epsilonReason, "");
  } finally {
    await rm(checkpoint, { recursive: true });
  }
});
