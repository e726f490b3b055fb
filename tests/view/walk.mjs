// Whatever is chosen, by list and slider: something of it is on the canvas.
import assert from "node:assert/strict";
import { picture, shown, until } from "./stage.mjs";

// Of the canvas: a part that is seen at a glance, or, while there are a few dots, which may hide each
// other, some of them.
const kLeast = 0.0005;
const kDot = 0.00001;

// Waits until what is chosen is drawn, and looks at it; `saw` may take a picture.
async function see(page, what, saw) {
  const { share } = await picture(page);
  await saw?.(what);
  const { vertices } = await shown(page);
  assert.ok(share >= Math.min(kLeast, kDot * vertices), `${what}: ${share} of the canvas is mesh, of ${vertices} vertices`);
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

// A demonstration that leads through these, as they grow and when they are done. It does not wait for a
// slow browser: what is looked at is what it shows by then, and the last of them it stays with.
export async function follow(page, labels, saw) {
  for (let at = 0; at < labels.length; at++) {
    await until(
      page,
      (coming) => {
        const label = document.querySelector("#facts b")?.textContent;
        return coming.includes(label) && Number(document.getElementById("stage").dataset.vertices) > 0;
      },
      labels.slice(at),
    );
    const label = await page.locator("#facts b").first().innerText();
    at = labels.indexOf(label);
    await see(page, `${label}, growing`, saw);
    await until(
      page,
      (label) =>
        document.querySelector("#facts b")?.textContent !== label ||
        document.querySelector("#verdict .headline") !== null,
      label,
    );
    await see(page, `${label}, or the next, done`, saw);
  }
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
  }
}
