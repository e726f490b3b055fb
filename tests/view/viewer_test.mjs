// `stellate view` in a real browser: what it shows.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import http from "node:http";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { finished, freePort, glance, hues, picture, setStage, shown, until } from "./stage.mjs";
import { choose, walk } from "./walk.mjs";

const stage = setStage();

const text = (page, selector) => page.locator(selector).innerText();
const certified = () => document.querySelector("#verdict .headline")?.textContent === "Certified";

test("a finished mesh, its numbers and its certificate", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.1, label: "a torus" });
  const page = await stage.look(name);
  await until(page, certified);
  await finished(page);
  await until(page, () => document.querySelectorAll("#histograms canvas").length === 4);

  const { share, parts, colours, vertices } = await picture(page);
  assert.ok(vertices > 800);
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
    assert.ok(!url.includes(key) && !url.includes(page.gateway.secret), url);
  }
  assert.ok(
    page.requested.every(
      (url) =>
        new URL(url).port === page.gateway.port ||
        url.startsWith("blob:") ||
        url.startsWith("data:"),
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
  await page.close();
  page.gateway.process.kill("SIGINT");
  assert.deepEqual(await page.gateway.ended, [0, null], "Ctrl-C ends it well");
});

test("a mesh grows before one's eyes, and goes on with the gateway's successor", async () => {
  const port = `${await freePort()}`;
  const name = await stage.mesh({
    shape: "two spheres",
    epsilon: 0.12,
    hold: 700,
    label: "growing",
  });
  const first = await stage.gateway(name, "--port", port);
  const page = await stage.page(first.url);
  await until(page, () => Number(document.getElementById("stage").dataset.vertices) > 20);
  await until(page, () => /a worker at [^]*\d/.test(document.getElementById("workers").innerText));
  assert.ok(await page.locator("#right").evaluate((e) => e.scrollWidth <= e.clientWidth));
  const early = await picture(page);
  first.process.kill("SIGKILL");
  await first.ended;
  await until(page, () =>
    document.getElementById("connection").textContent.includes("Not connected"),
  );
  const second = await stage.gateway(name, "--port", port);
  assert.equal(second.url, first.url, "the page that is open is known to it");
  stage.begin();
  await stage.over();
  await until(page, certified);
  await finished(page);
  const report = /vertices ([\d,]+)/.exec(await text(page, "#facts"))[1].replaceAll(",", "");
  const late = await picture(page);
  assert.equal(late.vertices, Number(report));
  assert.ok(late.vertices > early.vertices, `${late.vertices} after ${early.vertices}`);
  assert.notEqual(late.digest, early.digest);
  assert.equal(late.parts, 2, "both components are there");
  assert.match(await text(page, "#verdict"), /Components\s+2/);
  assert.equal(late.simplices, 2 * late.vertices - 8, "no simplex came twice or was lost");
  await until(page, () => document.getElementById("connection").textContent === "");
});

test("regions and the boundary alone are told by colour", async () => {
  await stage.mesh({ shape: "grain", epsilon: 0.25, label: "two materials" });
  await stage.mesh({ shape: "grain", epsilon: 0.25, boundary_only: true, label: "its boundary" });
  const page = await stage.look();
  await choose(page, "two materials");
  await finished(page);
  assert.equal(await page.locator("#colour").inputValue(), "region");
  assert.equal(await page.locator("#part").inputValue(), "cut", "what is inside is seen");
  const legend = await page.locator("#walls span").allInnerTexts();
  assert.deepEqual(legend, ["region 1", "region 2"]);
  const regions = await hues(page);
  assert.ok(regions.blue > 0.05 && regions.yellow > 0.01, JSON.stringify(regions));
  await page.locator("#part").selectOption("slice");
  const slice = await hues(page);
  assert.ok(slice.blue > 0.05 && slice.yellow > 0.01, JSON.stringify(slice));
  await page.locator("#part").selectOption("boundary");
  assert.ok((await hues(page)).yellow < 0.001, "the grain is within");
  await page.locator("#colour").selectOption("wall");
  assert.equal(await page.locator("#walls span").count(), 7);

  await choose(page, "its boundary");
  await finished(page);
  assert.match(await text(page, "#facts"), /2 in R³/);
  assert.equal(await page.locator("#part").inputValue(), "whole");
  assert.ok((await hues(page)).blue > 0.05);
  assert.equal(
    await page.locator("#verdict li.fails").count(),
    0,
    "what is certified fails nothing",
  );
  const plain = await picture(page);
  await page.locator("#colour").selectOption("wall");
  assert.notEqual((await picture(page)).digest, plain.digest, "its walls are told apart");
});

test("a reconstruction shows what became of its points", async () => {
  await stage.mesh({ points: "cap", label: "a cap" });
  const page = await stage.look();
  await choose(page, "a cap");
  await finished(page);
  await until(page, () => document.querySelector('#colour option[value="place"]') !== null);
  await page.locator("#colour").selectOption("place");
  await until(page, () => document.querySelectorAll("#walls span").length >= 2);
  const legend = await page.locator("#walls span").allInnerTexts();
  assert.ok(legend.includes("ok") && legend.includes("edge"), legend.join());
  const right = await text(page, "#right");
  assert.doesNotMatch(right, /epsilon|break a rule/i, "points have none");
  await until(page, () => window.hues().yellow > 0.0005, undefined);
  await page.locator("#colour").selectOption("plain");
  assert.ok((await hues(page)).yellow < 0.0005, "the colour is that of the edge");
});

test("meshes with boundary show where they end, by wall", async () => {
  await stage.mesh({ shape: "octant", epsilon: 0.2, label: "an octant" });
  const cube = await stage.mesh({ shape: "cube", epsilon: 0.7, label: "a cube" });
  const page = await stage.look(cube);
  await until(page, certified);
  await finished(page);
  assert.match(await text(page, "#facts"), /boundary\s+\d+ triangles in 1 part, 8 corners/);
  assert.match(await text(page, "#verdict"), /or in one and in the boundary/);
  assert.equal(await page.locator("#walls span").count(), 6);
  assert.equal(await page.locator("#part").inputValue(), "boundary");
  // Three walls are seen at once, each in its colour.
  const coloured = await picture(page);
  await page.locator("#colour").selectOption("plain");
  assert.ok((await picture(page)).colours < coloured.colours, "walls are told apart");
  await page.locator("#part").selectOption("slice");
  const slice = await picture(page);
  assert.ok(slice.share > 0.01 && slice.share < coloured.share, "a slice is less than the solid");

  await page.locator("#list button", { hasText: "an octant" }).click();
  await until(page, () => document.getElementById("facts").textContent.includes("an octant"));
  await finished(page);
  assert.match(await text(page, "#facts"), /boundary\s+\d+ edges in 1 part, 3 corners/);
  assert.equal(await page.locator("#walls span").count(), 3);
});

// Frames are drawn no more, once it is told so, until they are let go. What comes to be drawn is counted.
function holdFrames() {
  const draw = window.requestAnimationFrame.bind(window);
  const held = [];
  window.hold = false;
  window.scenes = 0;
  window.requestAnimationFrame = (frame) =>
    draw((now) => (window.hold ? held.push(frame) : frame(now)));
  window.release = () => {
    window.hold = false;
    held.splice(0).forEach(draw);
  };
  window.Worker = class extends Worker {
    constructor(...of) {
      super(...of);
      this.addEventListener("message", ({ data }) => {
        if (data.type === "scene" && window.hold) window.scenes++;
      });
    }
  };
}

test("a page that falls behind goes on with the newest revision", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.1, wait: true, label: "unseen" });
  const page = await stage.look(name, holdFrames);
  await until(page, () => document.getElementById("note").textContent.includes("first vertices"));
  await page.evaluate(() => (window.hold = true));
  stage.begin();
  await stage.over();
  await until(page, certified);
  const watch = () => page.sockets.find((socket) => socket.url().endsWith("/call/WatchMesh"));
  while (!watch()) await page.waitForEvent("websocket");
  if (!watch().isClosed()) await watch().waitForEvent("close"); // all of it came
  const { scenes, newest } = await page.evaluate(() => {
    const newest = Number(document.getElementById("revision").max);
    return { scenes: window.scenes, newest };
  });
  assert.ok(newest > 5 && scenes <= 1, `${scenes} of ${newest} revisions wait to be drawn`);
  await page.evaluate(() => window.release());
  await until(
    page,
    (newest) => document.getElementById("stage").dataset.revision === `${newest}`,
    newest,
  );
});

test("meshes of all dimensions, there and back, are seen at every revision", async () => {
  const labels = ["a surface", "three dimensions in six", "another surface"];
  await stage.mesh({ shape: "torus", epsilon: 0.15, label: labels[0] });
  await stage.mesh({ shape: "flat torus", epsilon: 0.7, label: labels[1] });
  const name = await stage.mesh({ shape: "two spheres", epsilon: 0.2, label: labels[2] });
  const page = await stage.look(name);
  await walk(page, labels);
});

test("a mesh at fault leads to where it is", async () => {
  const name = await stage.mesh({ shape: "torus", epsilon: 0.1, max_rounds: 6, label: "stopped" });
  const page = await stage.look(name);
  await finished(page);
  const before = await picture(page);
  await page.locator("#verdict .fault").first().click();
  await until(page, () => document.querySelector("#fault span").textContent.startsWith("1 of "));
  const there = await picture(page);
  assert.notEqual(there.digest, before.digest, "the camera flew");
  assert.match(await text(page, "#fault"), /^1 of \d+: the star of vertex \d+/);
  await page.locator("#verdict .fault").first().click();
  await until(page, () => document.querySelector("#fault span").textContent.startsWith("2 of "));
  assert.notEqual((await picture(page)).digest, there.digest, "and on to the next");
  assert.match(await text(page, "#fault"), /^2 of \d+: /);
  await page.locator("#fault-leave").click();
  assert.ok(await page.locator("#fault").isHidden());
  assert.match(await text(page, "#verdict"), /Not certified/);
});

test("what the certificate's words name leads there, too", async () => {
  await stage.mesh({ shape: "torus", epsilon: 0.3, label: "beside it" });
  const name = await stage.mesh({ shape: "thin torus", epsilon: 0.25, label: "too coarse" });
  const page = await stage.look(name);
  await finished(page);
  assert.match(await text(page, "#verdict"), /^Not certified/);
  const marks = await page.locator("#verdict li.fails .name").allInnerTexts();
  assert.deepEqual(marks, ["Circumradius", "Reach"], "marks say so, too");
  const before = await picture(page);
  const place = await page.locator("#verdict .place").first().innerText();
  await page.locator("#verdict .place").first().click();
  await until(page, () => !document.getElementById("fault").hidden);
  assert.equal((await text(page, "#fault")).split("\n")[0].replace(/ ?(next|leave).*/, ""), place);
  assert.notEqual((await picture(page)).digest, before.digest);

  // It does not take the next mesh's first sight with it.
  await page.locator("#fault-leave").click();
  await choose(page, "beside it");
  await choose(page, "too coarse");
  await finished(page);
  const { sides } = await picture(page);
  const same = sides.every((side, i) => Math.abs(side - before.sides[i]) <= 1);
  assert.ok(same, `${sides}, and ${before.sides} before the flight`);
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
  const page = await stage.look(name);
  await until(page, certified);
  await finished(page);
  const seen = new Set();
  const look = async (what) => {
    const { share, digest } = await picture(page);
    assert.ok(share > 0.01, `${what}: ${share} of the canvas is mesh`);
    assert.ok(!seen.has(digest), `${what} shows something else`);
    seen.add(digest);
  };
  const turns = async () => {
    const { digest } = await glance(page);
    const another = (digest) => window.glance().digest !== digest && window.glance().share > 0.01;
    await until(page, another, digest);
  };
  await look("a slice");
  await page.locator("#level").fill("0.3");
  await look("another level");
  await page.locator("#part").selectOption("below");
  await look("a shell");
  await page.locator("#axis-0").selectOption("5");
  await look("other axes");
  await page.locator("#tour").check();
  await turns();
  await turns();
  const live = await shown(page);
  assert.ok(live.simplices > 500);
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
  await finished(alone);
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
  await alone.close();

  const dull = await stage.page(pathToFileURL(file).href, withoutWebGL);
  await until(dull, certified);
  await finished(dull);
  await until(dull, () => document.getElementById("note").textContent.includes("WebGL"));
  assert.ok(await dull.locator("#note").isVisible(), "it says why nothing is drawn");
  assert.deepEqual(await shown(dull), live);
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
    const page = await stage.page(`http://${host}:${server.address().port}/`);
    server.close();
    return page;
  };
  const notebook = await framed("127.0.0.1");
  const frame = notebook.frames()[1];
  await until(frame, certified);
  await until(frame, () => Number(document.getElementById("stage").dataset.vertices) > 100);

  const elsewhere = await framed("127.0.0.2");
  const refused = (said) => said.includes("frame-ancestors");
  while (!elsewhere.said.some(refused)) await elsewhere.waitForEvent("console");
  assert.equal(await elsewhere.frames()[1].locator("#canvas").count(), 0);
});
