// `stellate view --demo` in a real browser, from its first mesh to its last.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { setStage, until } from "./stage.mjs";
import { choose, follow, walk } from "./walk.mjs";

// What it shows, in its own order.
const source = new URL("../../clients/view/gateway/demo.cc", import.meta.url);
const exhibits = [...readFileSync(source, "utf8").matchAll(/Exhibit\{"([^"]+)"/g)].map((m) => m[1]);

const stage = setStage();

test("a demonstration goes through the catalogue by itself, all of it seen", async () => {
  assert.ok(exhibits.length >= 10);
  const demo = await stage.viewer("--demo");
  const page = await stage.page(demo.url);
  await follow(page, exhibits);
  await walk(page, exhibits);
  await page.close();
  demo.process.kill("SIGINT");
  assert.deepEqual(await demo.ended, [0, null], "Ctrl-C ends it well");
});

test("what somebody chooses stays, whatever the demonstration makes next", async () => {
  const demo = await stage.viewer("--demo");
  const page = await stage.page(demo.url);
  const there = (count) => document.querySelectorAll("#list button").length >= count;
  await until(page, there, 2);
  await choose(page, exhibits[0]);
  await until(page, there, 4);
  assert.equal(await page.locator("#facts b").first().innerText(), exhibits[0]);
  await page.close();
  demo.process.kill("SIGINT");
  await demo.ended;
});
