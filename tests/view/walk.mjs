// Whatever is chosen, by list and slider: something of it is on the canvas.
import assert from "node:assert/strict";
import { picture, until } from "./stage.mjs";

// Shares of the canvas: a mesh is seen at a glance, a small one by a part of each vertex. Dots may all
// lie behind one of them.
const kLeast = 0.0005;
const kDot = 0.00001;

function assertSeen({ share, vertices, simplices }, what) {
  const least = simplices > 0 ? Math.min(kLeast, kDot * vertices) : Math.min(kDot, vertices);
  const words = `${what}: ${share} of the canvas is mesh, of ${vertices} vertices`;
  assert.ok(vertices > 0 ? share >= least : share === 0, words);
}

async function see(page, what) {
  const seen = await picture(page);
  assertSeen(seen, what);
  if (seen.vertices === 0) assert.ok(await page.locator("#note").isVisible(), `${what}: no word`);
  return seen;
}

// Some of it is drawn. Its row may be made anew while it is pressed: it holds news of the mesh.
export async function choose(page, label) {
  await page.locator("#list button", { has: page.getByText(label, { exact: true }) }).click();
  await until(
    page,
    (label) =>
      document.querySelector("#facts b")?.textContent === label &&
      Number(document.getElementById("stage").dataset.vertices) > 0,
    label,
  );
}

// In the page: keeps what was on the canvas of each mesh, at first and when it was done.
function remember() {
  const at = (id) => document.getElementById(id);
  const { dataset } = at("stage");
  window.exhibits = {};
  const tell = () => {
    const label = document.querySelector("#facts b")?.textContent;
    if (!label || dataset.vertices === "0") return;
    const one = (window.exhibits[label] ??= { first: window.glance(), revisions: [], dots: false });
    if (one.revisions.at(-1) !== dataset.revision) one.revisions.push(dataset.revision);
    one.dots ||= dataset.simplices === "0";
    const over = document.querySelector("#verdict .headline") && at("live").disabled;
    if (!over || dataset.revision !== at("revision").max) return;
    if (at("play").textContent === "replay") one.done = window.glance();
  };
  const watcher = new MutationObserver(tell);
  watcher.observe(at("stage"), { attributeFilter: ["data-revision", "data-vertices"] });
  for (const id of ["verdict", "live", "play"]) {
    watcher.observe(at(id), { attributes: true, childList: true });
  }
}

// A demonstration that leads through these, each in its turn, as they grow. It does not wait for whoever
// looks: the page itself keeps what is seen.
export async function follow(page, labels) {
  await page.evaluate(remember);
  for (const label of labels) {
    await until(page, (label) => window.exhibits[label]?.done !== undefined, label);
    const { first, done, revisions } = await page.evaluate(
      (label) => window.exhibits[label],
      label,
    );
    assertSeen(first, `${label}, growing`);
    assertSeen(done, `${label}, done`);
    // A page that is slow may see the end first: the steps below hold that it grew.
    assert.ok(first.vertices <= done.vertices && done.simplices > 0, label);
    // Half of them at least, as they come or afterwards.
    const steps = new Set(revisions).size;
    const least = Math.min(done.revision / 2 - 1, 25);
    assert.ok(steps >= least, `${label} is seen to grow: ${steps} steps of ${done.revision}`);
  }
  const dots = await page.evaluate(() => Object.values(window.exhibits).some(({ dots }) => dots));
  assert.ok(dots, "dots come first");
}

// Every mesh of these, there and back again, each at revisions from its first vertices to its end.
export async function walk(page, labels) {
  for (const label of [...labels, ...labels.toReversed()]) {
    await choose(page, label);
    await see(page, label);
    const newest = await page.evaluate(() => Number(document.getElementById("revision").max));
    for (const revision of new Set([1, Math.ceil(newest / 2), newest - 1, newest])) {
      await page.locator("#revision").fill(`${revision}`);
      await until(
        page,
        (revision) => document.getElementById("stage").dataset.revision === `${revision}`,
        revision,
      );
      await see(page, `${label}, revision ${revision}`);
    }
    await page.locator("#fit").click();
    const { lowest } = await see(page, `${label}, all of it`);
    assert.ok(lowest <= (await toolsBegin(page)), `${label}: the tools hide its lower end`);
  }
}

// As `lowest` of a picture.
const toolsBegin = (page) =>
  page.evaluate(() => {
    const canvas = document.getElementById("canvas").getBoundingClientRect();
    return (
      (document.getElementById("look").getBoundingClientRect().top - canvas.top) / canvas.height
    );
  });
