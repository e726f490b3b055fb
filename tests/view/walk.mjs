// Whatever is chosen, by list and slider: something of it is on the canvas.
import assert from "node:assert/strict";
import { picture, shown, until } from "./stage.mjs";

// Shares of the canvas: a mesh is seen at a glance, a small one by a part of each vertex. Dots may all
// lie behind one of them.
const kLeast = 0.0005;
const kDot = 0.00001;

// Waits until what is chosen is drawn, and looks at it; `saw` may take a picture.
async function see(page, what, saw) {
  const { vertices, simplices } = await shown(page); // it may grow until it is looked at
  const { share } = await picture(page);
  await saw?.(what);
  assert.ok(
    share >= (simplices > 0 ? Math.min(kLeast, kDot * vertices) : kDot),
    `${what}: ${share} of the canvas is mesh, of ${vertices} vertices`,
  );
}

// Until some of it is drawn.
function there(page, label) {
  return until(
    page,
    (label) =>
      document.querySelector("#facts b")?.textContent === label &&
      Number(document.getElementById("stage").dataset.vertices) > 0,
    label,
  );
}

export async function choose(page, label) {
  await page.locator("#list button", { has: page.getByText(label, { exact: true }) }).click();
  await there(page, label);
}

// A demonstration that leads through these, each in its turn, as they grow.
export async function follow(page, labels, saw) {
  await page.evaluate(() => {
    window.told = [];
    const { dataset } = document.getElementById("stage");
    const tell = () => {
      const label = document.querySelector("#facts b")?.textContent;
      window.told.push({
        label,
        vertices: Number(dataset.vertices),
        simplices: Number(dataset.simplices),
      });
    };
    new MutationObserver(tell).observe(document.getElementById("stage"), {
      attributeFilter: ["data-vertices"],
    });
  });
  for (const label of labels) {
    await there(page, label);
    await see(page, `${label}, growing`, saw);
    await until(
      page,
      () =>
        document.querySelector("#verdict .headline") !== null &&
        document.getElementById("play").textContent === "replay" &&
        document.getElementById("live").disabled &&
        document.getElementById("stage").dataset.revision ===
          document.getElementById("revision").max,
    );
    await see(page, `${label}, done`, saw);
    const told = await page.evaluate(() => window.told);
    const sizes = told.filter((one) => one.label === label && one.vertices > 0);
    const steps = new Set(sizes.map(({ vertices }) => vertices)).size;
    assert.ok(steps >= 5, `${label} is seen to grow: ${steps} steps`);
    assert.ok(sizes.at(-1).simplices > 0, label);
  }
  const told = await page.evaluate(() => window.told);
  assert.ok(
    told.some(({ vertices, simplices }) => vertices > 0 && simplices === 0),
    "dots come first",
  );
}

// Every mesh of these, there and back again, each at revisions from its first vertices to its end.
export async function walk(page, labels, saw) {
  for (const label of [...labels, ...labels.toReversed()]) {
    await choose(page, label);
    await see(page, label, saw);
    const newest = await page.evaluate(() => Number(document.getElementById("revision").max));
    for (const revision of new Set([1, Math.ceil(newest / 2), newest - 1, newest])) {
      await page.locator("#revision").fill(`${revision}`);
      await until(
        page,
        (revision) => document.getElementById("stage").dataset.revision === `${revision}`,
        revision,
      );
      await see(page, `${label}, revision ${revision}`, saw);
    }
    await page.locator("#fit").click();
    await see(page, `${label}, all of it`, saw);
    const { lowest } = await picture(page);
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
