// `stellate view` in a real browser: how meshes look at first, and in windows of all sizes.
import assert from "node:assert/strict";
import { test } from "node:test";
import { finished, glance, picture, resize, setStage, still, until } from "./stage.mjs";
import { choose } from "./walk.mjs";

const stage = setStage();

const press = (page, label) =>
  page.locator("#list button", { has: page.getByText(label, { exact: true }) }).click();
const says = (page, words) =>
  until(page, (words) => document.getElementById("note").textContent.includes(words), words);

test("words about a mesh without vertices stand over nothing, and are true", async () => {
  const label = "stopped after six rounds of it";
  await stage.mesh({ shape: "torus", epsilon: 0.2, cancel: true, label: "cancelled" });
  await stage.mesh({ shape: "torus", epsilon: 0.2, max_rounds: 6, label });
  const page = await stage.look();
  await choose(page, label);
  await finished(page);
  assert.ok((await picture(page)).share > 0.001);
  const title = page.locator("#list .title", { hasText: label });
  assert.ok(await title.evaluate((e) => e.scrollWidth <= e.clientWidth), "its label is whole");

  await press(page, "cancelled");
  await says(page, "It was cancelled before its first vertex");
  assert.equal((await picture(page)).share, 0, "the last one is gone");
  assert.doesNotMatch(await page.locator("#verdict").innerText(), /Reach|Consistent/);
  assert.ok(await page.locator("#workers-box").isHidden(), "nobody is to serve what is over");
  assert.ok(await page.locator("#histograms-box").isHidden());

  await choose(page, label);
  await stage.mesh({ shape: "torus", epsilon: 0.2, wait: true, label: "waits" });
  await until(page, () => document.querySelectorAll("#list button").length === 3);
  await press(page, "waits");
  await says(page, "no worker serves it");
  assert.equal((await picture(page)).share, 0, "the last one is gone");
  stage.begin();
  await stage.over();
  await finished(page);
  await until(page, () => document.getElementById("note").hidden);
  assert.ok((await picture(page)).share > 0.01);
});

// From far away, by its button.
async function comesBack(page, sides, what) {
  await page.locator("#canvas").hover();
  await page.mouse.wheel(0, 500);
  await until(page, (width) => window.glance().sides[0] < 0.9 * width, sides[0]);
  await page.locator("#fit").click();
  const fitted = (await picture(page)).sides;
  const same = fitted.every((side, i) => Math.abs(side - sides[i]) <= 1);
  assert.ok(same, `${what} fills ${fitted} once it is fitted, ${sides} before`);
}

test("in a window of any size a mesh is chosen, whole and beside its certificate", async () => {
  await stage.mesh({ shape: "torus", epsilon: 0.2, label: "one" });
  await stage.mesh({ shape: "cube", epsilon: 0.7, label: "two" });
  const page = await stage.look();
  for (const width of [1600, 1000, 600, 1200]) {
    await resize(page, width, 760);
    for (const label of ["one", "two"]) {
      await choose(page, label);
      await finished(page);
      const { share, sides } = await picture(page);
      assert.ok(share > 0.05 && sides[0] < 199, `${label} at ${width}: ${share}, ${sides}`);
      await comesBack(page, sides, `${label} at ${width}`);
    }
    const cut = await page.evaluate(() => {
      const { scrollWidth, clientWidth } = document.documentElement;
      const narrow = [...document.querySelectorAll("#look select")].filter((select) => {
        const { width } = select.getBoundingClientRect();
        select.style.maxWidth = "none";
        const whole = select.getBoundingClientRect().width;
        select.style.maxWidth = "";
        return whole > width + 1;
      });
      return [scrollWidth > clientWidth, ...narrow.map(({ id }) => id)];
    });
    assert.deepEqual(cut, [false], `nothing is cut off at ${width}`);
  }
});

test("charts and mesh take the window's new width, and the new colours of day and night", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.2, label: "by day and night" });
  const page = await stage.look(name);
  const charts = () => document.querySelectorAll("#curves canvas, #histograms canvas").length === 5;
  await finished(page);
  await until(page, charts);
  for (const width of [600, 1200]) {
    await resize(page, width, 760);
    await until(page, () => {
      const { right } = document.getElementById("histograms").getBoundingClientRect();
      const all = [...document.querySelectorAll("#curves canvas, #histograms canvas")];
      return all.every((one) => Math.abs(one.getBoundingClientRect().right - right) < 2);
    });
  }
  await still(page);
  for (const [colorScheme, ground] of [
    ["dark", [14, 18, 24]],
    ["light", [238, 241, 245]],
  ]) {
    await page.emulateMedia({ colorScheme });
    // By night nothing of a chart is white, and by day its lines are nearly so.
    await until(
      page,
      (night) => {
        const all = [...document.querySelectorAll("#curves canvas, #histograms canvas")];
        return all.every((one) => {
          const { data } = one.getContext("2d").getImageData(0, 0, one.width, one.height);
          const white = (_, i) => i % 4 === 0 && Math.min(...data.subarray(i, i + 4)) > 200;
          return data.some(white) !== night;
        });
      },
      colorScheme === "dark",
    );
    await still(page);
    assert.deepEqual((await glance(page)).ground, ground);
  }
});

test("a plane curve is seen from above, and is no pale line", async () => {
  const name = await stage.mesh({ shape: "circle", epsilon: 0.1, label: "a circle" });
  const page = await stage.look(name);
  for (const colorScheme of ["light", "dark"]) {
    await page.emulateMedia({ colorScheme });
    await page.reload();
    await finished(page);
    const [width, height] = (await picture(page)).sides;
    assert.ok(Math.abs(width / height - 1) < 0.05, `round: ${width} x ${height}`);
    const contrast = await page.evaluate(() => {
      const light = (name) => {
        const hex = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
        const [r, g, b] = [1, 3, 5].map((i) => (parseInt(hex.slice(i, i + 2), 16) / 255) ** 2.2);
        return 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05;
      };
      const [a, b] = [light("--curve"), light("--stage")];
      return Math.max(a / b, b / a);
    });
    assert.ok(contrast > 3, `${contrast} to 1 in ${colorScheme}`);
  }
  assert.ok(await page.locator("#part").isHidden(), "there is nothing to choose");
});

test("a slice is seen from an oblique side, by a coordinate that changes on it", async () => {
  await stage.mesh({ shape: "four-sphere", epsilon: 0.7, label: "four" });
  await stage.mesh({ shape: "flat torus", epsilon: 0.7, label: "three" });
  const page = await stage.look();
  for (const label of ["four", "three"]) {
    await choose(page, label);
    await finished(page);
    const chosen = await page.evaluate(() =>
      ["part", "axis", "colour", "axis-0"].map((id) => document.getElementById(id).value),
    );
    assert.equal(chosen[0], "slice");
    assert.notEqual(chosen[1], chosen[2], "the coordinate of the slice colours nothing");
    assert.equal(chosen[3], "", "no axis alone");
    const named = page.getByRole("combobox", { name: /./ });
    assert.equal(await named.count(), await page.locator("select:visible").count());
    const { share } = await picture(page);
    assert.ok(share > 0.08, `${label} is no smear: ${share}`);
  }
  // At its end there is nothing, and words say so.
  await page.locator("#level").fill("0");
  await says(page, "Nothing of it is at this level");
});
