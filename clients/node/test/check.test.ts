import assert from "node:assert/strict";
import { test } from "node:test";
import * as stellate from "../src/index.js";
import { torusCounts } from "./live.js";

const torus = new stellate.Torus();

/** The torus, its answers changed. */
function changed(change: (points: Float64Array) => void): stellate.Oracle {
  return {
    dimension: 2,
    ambientDimension: 3,
    boundingBox: torus.boundingBox,
    closestPoint(x, n) {
      const answer = torus.closestPoint(x, n);
      change(answer.points);
      return answer;
    },
  };
}

test("the doctor passes a torus, and epsilon 'auto' is a quarter of its reach", async () => {
  const report = await stellate.check(torus, { epsilon: 0.3 });
  assert(report.ok, report.text);
  assert(report.reach !== undefined && report.reach > 0.39 && report.reach < 0.41);
  assert.equal(report.pieces, 1);
  assert(report.samples >= 300 && report.queries > 1000);
  assert.deepEqual([...report.rates.keys()].slice(0, 2), [1, 10]);
  const codes = report.findings.map(({ severity, code }) => `${severity} ${code}`);
  assert(codes.includes("WARNING COARSE_EPSILON") && codes.includes("NOTE REACH"), codes.join());
  assert.match(report.text, /keeps its contract/);

  const { epsilon, reason } = await stellate.chooseEpsilon(torus);
  assert.equal(epsilon, 0.1);
  assert.match(reason, /^a quarter of the reach, about 0\.4/);
  const mesh = await stellate.mesh(torus, { epsilon: "auto" });
  assert.deepEqual([mesh.vertexCount, mesh.simplexCount], torusCounts);
});

test("the doctor names what is wrong, and no epsilon is chosen", async () => {
  const moving = changed((points) => points.forEach((value, i) => (points[i] = 1.01 * value)));
  const report = await stellate.check(moving);
  assert(!report.ok);
  const found = report.findings.find(({ code }) => code === "NOT_IDEMPOTENT");
  assert.equal(found?.severity, "ERROR");
  assert.match(found?.advice ?? "", /Answer with points of M/);
  await assert.rejects(stellate.chooseEpsilon(moving), (error) => {
    assert(error instanceof stellate.OracleError);
    assert.equal(error.reason, "ORACLE_BREAKS_CONTRACT");
    return /NOT_IDEMPOTENT/.test(error.message);
  });
  const raises = changed(() => {
    throw new Error("no such surface");
  });
  const [first] = (await stellate.check(raises)).findings;
  assert.equal(first.code, "RAISED");
  assert.match(first.message, /no such surface/);
});
