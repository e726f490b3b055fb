// `stellate view` in a real browser: what is read off a mesh, by pointer, keyboard and file.
import assert from "node:assert/strict";
import { once } from "node:events";
import { readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { finished, hues, picture, setStage, still, until } from "./stage.mjs";
import { choose } from "./walk.mjs";

const stage = setStage();

const text = (page, selector) => page.locator(selector).innerText();

async function see(wish, script, moves) {
  const page = await stage.look(await stage.mesh(wish), script, moves);
  await finished(page);
  return page;
}

// Somewhere on the mesh: the pixel of it that is nearest to the middle of the lower half.
const onMesh = (page) =>
  page.evaluate(() => {
    const canvas = document.getElementById("canvas");
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    const box = canvas.getBoundingClientRect();
    for (let y = Math.round(canvas.height * 0.55); y > 0; y--) {
      const at = 4 * (y * canvas.width + Math.round(canvas.width / 2));
      const away = [0, 1, 2].some((i) => Math.abs(data[at + i] - data[i]) > 24);
      if (away)
        return { x: box.x + box.width / 2, y: box.y + (y - 6) / (canvas.height / box.height) };
    }
    return null;
  });

const rows = (page, id) =>
  page.evaluate((id) => {
    const names = [...document.querySelectorAll(`#${id} dt`)].map((e) => e.textContent);
    const texts = [...document.querySelectorAll(`#${id} dd`)].map((e) => e.textContent);
    return Object.fromEntries(names.map((name, i) => [name, texts[i]]));
  }, id);

test("a simplex and a vertex are what they are said to be", async () => {
  const page = await see({ shape: "torus", epsilon: 0.15, label: "a torus" });
  const bare = await picture(page);
  const place = await onMesh(page);
  await page.mouse.move(place.x, place.y);
  await until(page, () => !document.getElementById("hint").hidden);
  assert.match(await text(page, "#hint b"), /^(simplex \d+ \d+ \d+|vertex \d+)$/);
  assert.equal((await picture(page)).digest, bare.digest, "who only points marks nothing");

  await page.mouse.click(place.x, place.y);
  await until(page, () => !document.getElementById("found").hidden);
  const marked = await picture(page);
  assert.notEqual(marked.digest, bare.digest, "what was pressed is marked");
  await page.mouse.move(2, 2);
  await until(page, () => document.getElementById("hint").hidden);

  // By number, without a pointer; the torus tells whether the coordinates are right.
  await page.locator("#find-ids").fill("17");
  await page.keyboard.press("Enter");
  await until(page, () => document.getElementById("found-title").textContent === "vertex 17");
  const vertex = await rows(page, "found-rows");
  const [x, y, z] = vertex.coordinates.split(", ").map(Number);
  assert.ok(Math.abs(Math.hypot(Math.hypot(x, y) - 1, z) - 0.4) < 1e-4, vertex.coordinates);
  assert.ok(Number(vertex["simplices about it"]) >= 3);
  await page.locator("#unpin").click();
  await until(page, () => document.getElementById("found").hidden);

  await page.locator("#find-ids").fill("1000000");
  await page.keyboard.press("Enter");
  await until(page, () => !document.getElementById("find-none").hidden);
  assert.ok(await page.locator("#found").isHidden());

  // From a file one knows a simplex there is.
  const cell = (await saved(page, "txt")).trim().split("\n").at(-1);
  await page.locator("#find-ids").fill(cell);
  await page.keyboard.press("Enter");
  await until(
    page,
    (c) => document.getElementById("found-title").textContent === `simplex ${c}`,
    cell,
  );
  const simplex = await rows(page, "found-rows");
  const [radius, share] = simplex.circumradius.match(/[\d.e-]+/g).map(Number);
  assert.ok(radius <= 0.15 && Math.abs(radius / 0.15 - share) < 0.01, simplex.circumradius);
  const [low, high] = simplex.angles.match(/[\d.]+/g).map(Number);
  assert.ok(low > 20 && low <= 60 && high >= 60 && high < 140, simplex.angles);
  await page.waitForTimeout(1000); // the flight
  assert.notEqual((await picture(page)).digest, bare.digest);
});

async function saved(page, format) {
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page.locator("#save").selectOption(format),
  ]);
  assert.match(download.suggestedFilename(), new RegExp(`^[a-z-]+\\.${format}$`));
  return readFileSync(await download.path(), format === "png" ? null : "utf8");
}

test("a corner knows its walls, a tetrahedron its region", async () => {
  const page = await see({ shape: "cube", epsilon: 0.7, label: "cube" });
  const lines = (await saved(page, "txt")).trim().split("\n").slice(1);
  const corner = lines.findIndex((line) => {
    const x = line.split(" ").map(Number);
    return x.length === 3 && x.every((c) => Math.abs(c - 1) < 1e-6);
  });
  await page.locator("#find-ids").fill(`${corner}`);
  await page.keyboard.press("Enter");
  await until(page, () => !document.getElementById("found").hidden);
  assert.match((await rows(page, "found-rows")).walls, /^\d, \d, \d$/);

  await stage.mesh({ shape: "grain", epsilon: 0.4, label: "grain" });
  await until(page, () => document.querySelectorAll("#list button").length > 1);
  await choose(page, "grain");
  await finished(page);
  const cell = (await saved(page, "txt")).trim().split("\n").at(-1);
  await page.locator("#find-ids").fill(cell);
  await page.keyboard.press("Enter");
  await until(page, () => document.getElementById("found-title").textContent.startsWith("simplex"));
  assert.match((await rows(page, "found-rows")).region, /^[12]$/);
});

test("colours, axes and lengths are told, also in the picture that is saved", async () => {
  const page = await see({ shape: "torus", epsilon: 0.15, label: "a torus" });
  const names = () =>
    page.locator("#overlay [aria-label]").evaluateAll((all) => all.map((e) => e.ariaLabel));
  assert.deepEqual((await names()).length, 2, "plain: no bar");
  await page.locator("#colour").selectOption("0");
  await still(page);
  const bar = (await names()).find((name) => name.startsWith("x₁, "));
  const [low, high] = bar.match(/-?[\d.]+/g).map(Number);
  assert.ok(Math.abs(low + 1.4) < 0.02 && Math.abs(high - 1.4) < 0.02, bar);
  assert.deepEqual((await page.locator("#overlay .axes text").allTextContents()).sort(), [
    "x₁",
    "x₂",
    "x₃",
  ]);

  // A length of the bar, in pixels, against the torus' own width where it is seen from above.
  const seen = await page.evaluate(() => {
    const [, length] = document.querySelector("#overlay .length").ariaLabel.split(" ");
    return document.querySelector("#overlay .length path").getBBox().width / Number(length);
  });
  const width =
    ((await picture(page)).sides[0] *
      (await page.locator("#canvas").evaluate((e) => e.clientWidth))) /
    200;
  assert.ok(Math.abs(width / seen / 2.8 - 1) < 0.25, `${width / seen} for 2.8`);

  const png = await saved(page, "png");
  assert.equal(png.subarray(1, 4).toString(), "PNG");
  const spots = await page.evaluate(
    async (bytes) => {
      const image = await createImageBitmap(new Blob([new Uint8Array(bytes)]));
      const copy = new OffscreenCanvas(image.width, image.height).getContext("2d");
      copy.drawImage(image, 0, 0);
      const canvas = document.getElementById("canvas");
      const [x, y, w, h] = ["x", "y", "width", "height"].map(
        (name) =>
          (Number(document.querySelector("#overlay .bar rect").getAttribute(name)) * canvas.width) /
          canvas.clientWidth,
      );
      const at = (t) => [...copy.getImageData(x + w / 2, y + t * h, 1, 1).data.subarray(0, 3)];
      return [at(0.03), at(0.97)];
    },
    [...png],
  );
  assert.ok(spots[0][0] > 200 && spots[0][2] < 90, `yellow above: ${spots[0]}`);
  assert.ok(spots[1][0] < 110 && spots[1][2] > 60, `violet below: ${spots[1]}`);
});

test("cut open, a solid shows what is inside, a surface its edge", async () => {
  const page = await see({ shape: "grain", epsilon: 0.3, label: "grain" });
  assert.equal(await page.locator("#part").inputValue(), "cut");
  const half = await hues(page);
  assert.ok(half.yellow > 0.01, "the grain is seen where it is cut");
  await page.locator("#level").fill("0.98");
  assert.ok((await hues(page)).yellow < half.yellow / 4, "it is not cut there");

  await stage.mesh({ shape: "torus", epsilon: 0.15, label: "torus" });
  await until(page, () => document.querySelectorAll("#list button").length > 1);
  await choose(page, "torus");
  await finished(page);
  const whole = await picture(page);
  await page.locator("#part").selectOption("cut");
  await page.locator("#axis").selectOption("0");
  const cut = await picture(page);
  assert.ok(cut.share < 0.8 * whole.share && cut.share > 0.2 * whole.share);
  await page.locator("#level").fill("0");
  assert.equal((await picture(page)).share, 0, "nothing is left");
});

test("axes of different units are drawn as one, and said in their own", async () => {
  const page = await see({ shape: "ellipsoid", epsilon: 0.35, label: "of three units" });
  const [width, height] = (await picture(page)).sides;
  assert.ok(Math.abs(width / height - 1) < 0.1, `drawn as a sphere: ${width} x ${height}`);
  const length = await page.locator("#overlay .length").getAttribute("aria-label");
  assert.match(length, / of x \/ scale$/);
  await page.locator("#find-ids").fill("7");
  await page.keyboard.press("Enter");
  await until(page, () => document.getElementById("found-title").textContent === "vertex 7");
  const [x, y, z] = (await rows(page, "found-rows")).coordinates.split(", ").map(Number);
  assert.ok(Math.abs((x / 0.01) ** 2 + (y / 500) ** 2 + z ** 2 - 1) < 1e-3, `${x}, ${y}, ${z}`);
  const [head, ...lines] = (await saved(page, "txt")).trim().split("\n");
  const points = lines.slice(0, Number(head.split(" ")[2])).map((line) => line.split(" ").map(Number));
  const most = [0, 1, 2].map((i) => Math.max(...points.map((point) => Math.abs(point[i]))));
  assert.ok(most[0] < 0.0101 && most[1] > 400 && most[1] < 505 && most[2] < 1.01, `${most}`);
});

test("a mesh is saved as programs read it: its triangles are turned outwards", async () => {
  const page = await see({ shape: "torus", epsilon: 0.2, label: "a torus" });
  const lines = (await saved(page, "obj")).split("\n");
  const of = (letter) =>
    lines
      .filter((line) => line.startsWith(`${letter} `))
      .map((line) => line.split(" ").slice(1).map(Number));
  const [points, faces] = [of("v"), of("f")];
  const six = ([a, b, c]) =>
    a[0] * (b[1] * c[2] - b[2] * c[1]) -
    a[1] * (b[0] * c[2] - b[2] * c[0]) +
    a[2] * (b[0] * c[1] - b[1] * c[0]);
  const volume = faces.reduce((sum, f) => sum + six(f.map((v) => points[v - 1])) / 6, 0);
  const exact = 2 * Math.PI ** 2 * 0.4 ** 2;
  assert.ok(Math.abs(volume / exact - 1) < 0.1, `outwards: encloses ${volume} of ${exact}`);
  const { simplices } = await picture(page);
  assert.equal(faces.length, simplices);
  const halves = faces.flatMap((f) => f.map((v, i) => `${v} ${f[(i + 1) % 3]}`));
  assert.equal(new Set(halves).size, halves.length, "each edge once in each direction");
  const vtu = await saved(page, "vtu");
  assert.match(vtu, new RegExp(`NumberOfCells="${simplices}"`));
  const good = await page.evaluate((xml) => {
    const parsed = new DOMParser().parseFromString(xml, "text/xml");
    return (
      parsed.querySelector("parsererror") === null && parsed.querySelectorAll("DataArray").length
    );
  }, vtu);
  assert.equal(good, 4);
});

test("the keyboard turns it, and everything has a name", async () => {
  const page = await see({ shape: "thin torus", epsilon: 0.15, label: "thin" });
  const first = await picture(page);
  await page.locator("#canvas").focus();
  for (const [keys, what] of [
    [["ArrowLeft", "ArrowLeft"], "turned"],
    [["ArrowUp"], "tilted"],
    [["-", "-", "-"], "smaller"],
  ]) {
    const before = await picture(page);
    for (const key of keys) await page.keyboard.press(key);
    assert.notEqual((await picture(page)).digest, before.digest, what);
  }
  const small = await picture(page);
  assert.ok(small.sides[0] < 0.85 * first.sides[0]);
  await page.keyboard.press("0");
  assert.ok((await picture(page)).sides[0] > small.sides[0], "all of it again");
  const nameless = await page.evaluate(() =>
    [...document.querySelectorAll("button, select, input, canvas#canvas")]
      .filter((e) => e.offsetParent !== null || e.id === "canvas")
      .filter((e) => !(e.ariaLabel || e.labels?.length || e.textContent.trim()))
      .map((e) => e.outerHTML),
  );
  assert.deepEqual(nameless, []);
  assert.match(await page.locator("#canvas").getAttribute("aria-label"), /thin.*vertices \d+/);
});

test("in more dimensions than three a mesh turns by itself, unless one minds", async () => {
  const name = await stage.mesh({ shape: "flat torus", epsilon: 0.7, label: "three" });
  const page = await stage.look(name, () => {}, true);
  await until(page, () => Number(document.getElementById("stage").dataset.simplices) > 0);
  assert.ok(await page.locator("#tour").isChecked());
  const digests = new Set();
  await page.waitForTimeout(1000);
  for (let i = 0; i < 5; i++) {
    await page.waitForTimeout(400);
    digests.add(await page.evaluate(() => window.glance().digest));
  }
  assert.ok(digests.size > 2, "it moves");
  await page.locator("#tour").uncheck();
  const at = await picture(page);
  await page.waitForTimeout(500);
  assert.equal((await picture(page)).digest, at.digest, "it rests");

  const quiet = await stage.look(name);
  await finished(quiet);
  assert.ok(!(await quiet.locator("#tour").isChecked()));
});

test("two meshes side by side are turned together", async () => {
  await stage.mesh({ shape: "torus", epsilon: 0.3, label: "coarse" });
  const page = await see({ shape: "torus", epsilon: 0.15, label: "fine" });
  const alone = await picture(page);
  const other = () =>
    page.evaluate(() => {
      const canvas = document.getElementById("beside-canvas");
      const copy = new OffscreenCanvas(120, 120).getContext("2d");
      copy.drawImage(canvas, 0, 0, 120, 120);
      const { data } = copy.getImageData(0, 0, 120, 120);
      let [ink, digest] = [0, 0];
      for (let i = 0; i < data.length; i += 4) {
        if (Math.abs(data[i] - data[0]) > 12) ink++;
        digest = (Math.imul(digest, 31) + data[i]) | 0;
      }
      return { ink: ink / (120 * 120), digest };
    });
  await page.locator("#beside").selectOption({ label: "coarse" });
  await until(page, () =>
    /coarse.*simplices/s.test(document.getElementById("beside-facts").textContent),
  );
  await still(page);
  await until(page, () => document.getElementById("stage").ariaBusy === "false");
  const [left, right] = [await picture(page), await other()];
  assert.ok(left.share > 0.05 && right.ink > 0.05, `${left.share}, ${right.ink}`);
  assert.ok(Math.abs(left.share - right.ink) < 0.03, "as large, and from the same side");

  await page.locator("#canvas").focus();
  for (let i = 0; i < 4; i++) await page.keyboard.press("ArrowDown");
  const [turned, followed] = [await picture(page), await other()];
  assert.notEqual(turned.digest, left.digest);
  assert.notEqual(followed.digest, right.digest);
  assert.ok(Math.abs(turned.share - followed.ink) < 0.03);
  await page.locator("#colour").selectOption("size");
  await still(page);
  assert.notEqual((await other()).digest, followed.digest, "coloured alike");

  await page.locator("#beside").selectOption("");
  await page.locator("#colour").selectOption("plain");
  await page.locator("#fit").click();
  assert.ok(await page.locator("#beside-canvas").isHidden());
  assert.ok((await picture(page)).sides[0] > 0.9 * alone.sides[0], "it has all the room again");
});

test("a file of five thousand vertices has less than 3 MB, and its revisions", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.0385, label: "many" });
  const file = join(stage.folder, "many.html");
  const view = stage.spawn(process.env.STELLATE, [
    "view",
    name,
    "--server",
    stage.address,
    "--html",
    file,
  ]);
  assert.deepEqual((await once(view, "exit"))[0], 0);
  assert.ok(statSync(file).size < 3e6, `${statSync(file).size} bytes`);
  const page = await stage.page(pathToFileURL(file).href);
  await finished(page);
  const { vertices, revision, share } = await picture(page);
  assert.ok(vertices > 5000, `${vertices} vertices`);
  await page.locator("#revision").fill(`${Math.floor(revision / 2)}`);
  await until(page, (r) => Number(document.getElementById("stage").dataset.revision) < r, revision);
  const earlier = await picture(page);
  assert.ok(earlier.vertices > 10 && earlier.vertices < vertices);
  assert.ok(earlier.share > 0.5 * share, "it is drawn");
});

test("a mesh that is deleted is still seen, and said to be gone", async () => {
  await stage.mesh({ shape: "torus", epsilon: 0.3, label: "stays" });
  const page = await see({ shape: "torus", epsilon: 0.25, label: "goes", delete: true });
  await until(page, () => document.querySelectorAll("#list button").length > 1);
  const { share } = await picture(page);
  stage.begin();
  await until(page, () =>
    /no longer on the server/.test(document.getElementById("facts").innerText),
  );
  assert.doesNotMatch(await text(page, "#list"), /goes/);
  assert.ok((await picture(page)).share > 0.9 * share);
  await choose(page, "stays");
  assert.doesNotMatch(await text(page, "#facts"), /no longer/);
});
