// `stellate view` in a real browser: what it shows.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import http from "node:http";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { kPatience, picture, shown, Stage, until } from "./stage.mjs";
import { walk } from "./walk.mjs";

let stage;
before(async () => (stage = await Stage.open()), { timeout: kPatience });
after(() => stage?.close());

const text = (page, selector) => page.locator(selector).innerText();
const certified = () => document.querySelector("#verdict .headline")?.textContent === "Certified";

test("a finished mesh, its numbers and its certificate", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.1, label: "a torus" });
  const gateway = await stage.gateway(name);
  const page = await stage.page(gateway.url);
  await until(page, certified);
  await until(page, () => Number(document.getElementById("stage").dataset.vertices) > 800);
  await until(page, () => document.querySelectorAll("#histograms canvas").length === 4);

  const { share, parts, colours } = await picture(page);
  assert.ok(share > 0.1 && share < 0.8, `${share} of the canvas is mesh`);
  assert.equal(parts, 1);
  assert.ok(colours > 20, "it is shaded");
  assert.match(await text(page, "#facts"), /a torus.*certified.*2 in R³/s);
  assert.match(await text(page, "#list"), /a torus/);
  assert.match(await text(page, "#verdict"), /Euler char\.\s+0/);
  assert.equal(await page.locator("#verdict li.holds").count(), 5);
  assert.equal(await page.locator("#verdict li.fails").count(), 0);
  assert.equal(await page.locator("#curves canvas").count(), 1);

  // The name of a mesh opens it, and the secret the page: neither goes into an address.
  const key = name.replace("meshes/", "");
  for (const url of page.requested.map((u) => u.split("#")[0])) {
    assert.ok(!url.includes(key) && !url.includes(gateway.secret), url);
  }
  assert.ok(
    page.requested.every(
      (url) =>
        new URL(url).port === gateway.port || url.startsWith("blob:") || url.startsWith("data:"),
    ),
  );

  // An earlier revision is another, smaller mesh; the newest comes back.
  const newest = await shown(page);
  const before = await picture(page);
  await page.locator("#revision").fill("4");
  await until(page, () => document.getElementById("stage").dataset.revision === "4");
  const earlier = await shown(page);
  assert.ok(earlier.vertices < newest.vertices / 2 && earlier.vertices > 0);
  assert.notEqual((await picture(page)).digest, before.digest);
  await page.locator("#live").click();
  await until(
    page,
    (r) => document.getElementById("stage").dataset.revision === `${r}`,
    newest.revision,
  );
  assert.deepEqual(page.faults, []);
  await page.close();
  gateway.process.kill("SIGINT");
  assert.deepEqual(await gateway.ended, [0, null], "Ctrl-C ends it well");
});

test("a mesh grows before one's eyes, and goes on with the gateway's successor", async () => {
  const port = 20000 + (process.pid % 20000);
  const name = await stage.mesh({
    shape: "two spheres",
    epsilon: 0.12,
    seconds: 0.25,
    label: "growing",
  });
  const first = await stage.gateway(name, "--port", `${port}`);
  const page = await stage.page(first.url);
  await until(page, () => Number(document.getElementById("stage").dataset.vertices) > 20);
  assert.match(await text(page, "#crew"), /a worker at .*\d/);
  const early = { ...(await shown(page)), ...(await picture(page)) };
  first.process.kill("SIGKILL");
  await first.ended;
  await until(page, () =>
    document.getElementById("connection").textContent.includes("Not connected"),
  );
  const second = await stage.gateway(name, "--port", `${port}`);
  assert.equal(second.url, first.url, "the page that is open is known to it");
  await stage.over();
  await until(page, certified);
  const report = /vertices ([\d,]+)/.exec(await text(page, "#facts"))[1].replaceAll(",", "");
  await until(page, (all) => document.getElementById("stage").dataset.vertices === all, report);
  const late = { ...(await shown(page)), ...(await picture(page)) };
  assert.ok(late.vertices > early.vertices, `${late.vertices} after ${early.vertices}`);
  assert.notEqual(late.digest, early.digest);
  assert.equal(late.parts, 2, "both components are there");
  assert.match(await text(page, "#verdict"), /Components\s+2/);
  assert.equal(late.simplices, 2 * late.vertices - 8, "no simplex came twice or was lost");
  assert.equal(await text(page, "#connection"), "");
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("meshes with boundary show where they end, by wall", async () => {
  await stage.mesh({ shape: "octant", epsilon: 0.2, label: "an octant" });
  const cube = await stage.mesh({ shape: "cube", epsilon: 0.7, label: "a cube" });
  const gateway = await stage.gateway(cube);
  const page = await stage.page(gateway.url);
  await until(page, certified);
  await until(page, () => document.getElementById("facts").textContent.includes("corners"));
  assert.match(await text(page, "#facts"), /boundary\s+\d+ triangles in 1 part, 8 corners/);
  assert.match(await text(page, "#verdict"), /or in one and in the boundary/);
  assert.equal(await page.locator("#walls span").count(), 6);
  assert.equal(await page.locator("#part").inputValue(), "boundary");
  // Three walls are seen at once, each in its colour.
  const coloured = await picture(page);
  await page.locator("#colour").selectOption("plain");
  await until(page, () => document.getElementById("colour").value === "plain");
  await page.waitForTimeout(300);
  assert.ok((await picture(page)).colours < coloured.colours, "walls are told apart");
  await page.locator("#part").selectOption("slice");
  await page.waitForTimeout(300);
  const slice = await picture(page);
  assert.ok(slice.share > 0.01 && slice.share < coloured.share, "a slice is less than the solid");

  await page.locator("#list button", { hasText: "an octant" }).click();
  await until(page, () => document.getElementById("facts").textContent.includes("an octant"));
  await until(page, () => document.getElementById("facts").textContent.includes("corners"));
  assert.match(await text(page, "#facts"), /boundary\s+\d+ edges in 1 part, 3 corners/);
  assert.equal(await page.locator("#walls span").count(), 3);
  assert.deepEqual(page.faults, []);
  await page.close();
});

// Frames are drawn no more, once it is told so, until they are let go.
function holdFrames() {
  const draw = window.requestAnimationFrame.bind(window);
  const held = [];
  window.hold = false;
  window.requestAnimationFrame = (frame) => (window.hold ? held.push(frame) : draw(frame));
  window.release = () => {
    window.hold = false;
    held.splice(0).forEach(draw);
  };
}

test("a page that falls behind goes on with the newest revision", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.1, wait: true, label: "unseen" });
  const gateway = await stage.gateway(name);
  const page = await stage.page(gateway.url, holdFrames);
  await until(page, () => document.getElementById("note").textContent.includes("first vertices"));
  await page.evaluate(() => {
    window.hold = true;
    const stage = document.getElementById("stage");
    window.seen = [];
    new MutationObserver(() => window.seen.push(Number(stage.dataset.revision))).observe(stage, {
      attributeFilter: ["data-revision"],
    });
  });
  stage.begin();
  await stage.over();
  await until(page, certified);
  await page.evaluate(() => window.release());
  await until(page, () => {
    const newest = document.getElementById("revision").max;
    return document.getElementById("stage").dataset.revision === newest;
  });
  const seen = await page.evaluate(() => window.seen);
  assert.ok(seen.at(-1) > 5 && seen.length <= 3, `revisions are left out: ${seen}`);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("meshes of all dimensions, there and back, are seen at every revision", async () => {
  const labels = ["a surface", "three dimensions in six", "another surface"];
  await stage.mesh({ shape: "torus", epsilon: 0.15, label: labels[0] });
  await stage.mesh({ shape: "flat torus", epsilon: 0.7, label: labels[1] });
  const name = await stage.mesh({ shape: "two spheres", epsilon: 0.2, label: labels[2] });
  const gateway = await stage.gateway(name);
  const page = await stage.page(gateway.url);
  await walk(page, labels);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a mesh at fault leads to where it is", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.1, max_rounds: 6, label: "stopped" });
  const gateway = await stage.gateway(name);
  const page = await stage.page(gateway.url);
  await until(page, () => document.querySelector("#verdict .fault") !== null);
  const before = await picture(page);
  await page.locator("#verdict .fault").first().click();
  await page.waitForTimeout(900); // a flight
  const there = await picture(page);
  assert.notEqual(there.digest, before.digest, "the camera flew");
  assert.match(await text(page, "#fault"), /^1 of \d+: the star of vertex \d+/);
  await page.locator("#verdict .fault").first().click();
  await page.waitForTimeout(900);
  assert.notEqual((await picture(page)).digest, there.digest, "and on to the next");
  assert.match(await text(page, "#fault"), /^2 of \d+: /);
  await page.locator("#fault-leave").click();
  assert.ok(await page.locator("#fault").isHidden());
  assert.match(await text(page, "#verdict"), /Not certified/);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("what the certificate's words name leads there, too", async () => {
  const name = await stage.mesh({ shape: "thin torus", epsilon: 0.25, label: "too coarse" });
  const gateway = await stage.gateway(name);
  const page = await stage.page(gateway.url);
  await until(page, () => document.querySelector("#verdict .place") !== null);
  assert.match(await text(page, "#verdict"), /^Not certified/);
  const marks = await page.locator("#verdict li.fails .name").allInnerTexts();
  assert.deepEqual(marks, ["Circumradius", "Reach"], "marks say so, too");
  const before = await picture(page);
  const place = await page.locator("#verdict .place").first().innerText();
  await page.locator("#verdict .place").first().click();
  await until(page, () => !document.getElementById("fault").hidden);
  assert.equal((await text(page, "#fault")).split("\n")[0].replace(/ ?(next|leave).*/, ""), place);
  await page.waitForTimeout(900); // a flight
  assert.notEqual((await picture(page)).digest, before.digest);
  assert.deepEqual(page.faults, []);
  await page.close();
});

// In the page, before its own scripts.
function withoutWebGL() {
  const { getContext } = HTMLCanvasElement.prototype;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...rest);
  };
}

test("a 3-manifold of R^6 by slices, shells and turns; the same in a file of its own", async () => {
  const name = await stage.mesh({ shape: "flat torus", epsilon: 0.6, label: "three circles" });
  const gateway = await stage.gateway(name);
  const page = await stage.page(gateway.url);
  await until(page, certified);
  await until(page, () => Number(document.getElementById("stage").dataset.simplices) > 500);
  const seen = new Set();
  const look = async (what) => {
    await page.waitForTimeout(400);
    const { share, digest } = await picture(page);
    assert.ok(share > 0.01, `${what}: ${share} of the canvas is mesh`);
    assert.ok(!seen.has(digest), `${what} shows something else`);
    seen.add(digest);
  };
  await look("a slice");
  await page.locator("#level").fill("0.3");
  await look("another level");
  await page.locator("#part").selectOption("below");
  await look("a shell");
  await page.locator("#axis-0").selectOption("5");
  await look("other axes");
  await page.locator("#tour").check();
  await look("a tour");
  await look("the tour, later");
  assert.deepEqual(page.faults, []);
  const live = await shown(page);
  await page.close();

  const file = join(stage.folder, "three circles.html");
  const writing = stage.spawn(process.env.STELLATE, [
    "view",
    name,
    "--server",
    stage.address,
    "--html",
    file,
  ]);
  const [status] = await new Promise((resolve) => writing.on("exit", (...end) => resolve(end)));
  assert.equal(status, 0);
  assert.ok(
    !readFileSync(file, "latin1").includes(name),
    "the name would open the mesh on its server",
  );
  const alone = await stage.page(pathToFileURL(file).href);
  await until(alone, certified);
  await until(alone, () => Number(document.getElementById("stage").dataset.simplices) > 500);
  assert.deepEqual(await shown(alone), live);
  assert.ok((await picture(alone)).share > 0.01);
  assert.ok(
    alone.requested.every((url) => /^(file|blob|data):/.test(url)),
    "it asks nobody for anything",
  );
  await alone.locator("#revision").fill("3");
  await until(
    alone,
    (all) => Number(document.getElementById("stage").dataset.vertices) < all,
    live.vertices,
  );
  assert.deepEqual(alone.faults, []);
  await alone.close();

  const dull = await stage.page(pathToFileURL(file).href, withoutWebGL);
  await until(dull, certified);
  await until(dull, () => document.getElementById("note").textContent.includes("WebGL"));
  assert.ok(await dull.locator("#note").isVisible(), "it says why nothing is drawn");
  assert.deepEqual(await shown(dull), live);
  await dull.close();
});

test("a notebook's frame shows it, live; a page from elsewhere has no frame of it", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.2, label: "in a frame" });
  const gateway = await stage.gateway(name);
  const framed = async (host) => {
    const server = http.createServer((_, response) => {
      response.setHeader("Content-Type", "text/html");
      response.end(`<iframe src="${gateway.url}" width="900" height="600"></iframe>`);
    });
    await new Promise((resolve) => server.listen(0, host, resolve));
    const page = await stage.browser.newPage();
    page.refused = page.waitForEvent("console", {
      predicate: (said) => said.text().includes("frame-ancestors"),
      timeout: kPatience,
    });
    page.refused.catch(() => {}); // where it is not
    await page.goto(`http://${host}:${server.address().port}/`);
    server.close();
    return page;
  };
  const notebook = await framed("127.0.0.1");
  const frame = notebook.frames()[1];
  await frame.waitForFunction(certified, undefined, { timeout: kPatience });
  await frame.waitForFunction(
    () => Number(document.getElementById("stage").dataset.vertices) > 100,
  );
  await notebook.close();

  const elsewhere = await framed("127.0.0.2");
  await elsewhere.refused;
  assert.equal(await elsewhere.frames()[1].locator("#canvas").count(), 0);
  await elsewhere.close();
});
