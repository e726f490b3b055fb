import assert from "node:assert/strict";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import * as stellate from "../src/index.js";
import { finer, finerEpsilon } from "../src/epsilon.js";

interface Case {
  about: string;
  report: Record<string, unknown> & { epsilon: number; estimated_reach: number | string };
  then: { epsilon: number; reason: string } | null;
}

const kit = new URL("../../../../tests/conformance/finer.json", import.meta.url);
const cases = JSON.parse(await readFile(kit, "utf8")) as Case[];

function reportOf({ report }: Case): stellate.Report {
  const certificate = {
    certified: report.certified ?? false,
    reachRefuted: report.reach_refuted ?? false,
    estimatedReach: Number(report.estimated_reach),
  };
  const termination = report.termination ?? "CONVERGED";
  return { termination, certificate, epsilon: report.epsilon } as stellate.Report;
}

test("what a mesh that is not certified is followed by is what the kit says", () => {
  for (const one of cases) {
    assert.deepEqual(finerEpsilon(reportOf(one)), one.then ?? undefined, one.about);
  }
  const choice = { epsilon: 0.1, reason: "so", retries: 2 };
  assert.equal(finer(choice, reportOf(cases[0]))?.retries, 1);
  assert.equal(finer({ ...choice, retries: 0 }, reportOf(cases[0])), undefined);
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
    assert.deepEqual(told[1], Object.values(finerEpsilon(ends[0].report) ?? {}));

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
