import assert from "node:assert/strict";
import { test } from "node:test";
import { general } from "../src/decimal.js";

test("numbers are written as C writes them", () => {
  const texts = [2 ** -25, -(2 ** -25), 0.125, 1e17, 123456, -0.0001, 5e-324, 0.1, -3].map((x) =>
    general(x, 17),
  );
  assert.deepEqual(texts, [
    "2.9802322387695312e-08",
    "-2.9802322387695312e-08",
    "0.125",
    "1e+17",
    "123456",
    "-0.0001",
    "4.9406564584124654e-324",
    "0.10000000000000001",
    "-3",
  ]);
  assert.deepEqual(
    [general(0.125, 2), general(0.375, 2), general(9.96, 2)],
    ["0.12", "0.38", "10"],
  );
});
