// `stellate view` in a real browser: what it shows, and whom it lets see it.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import http from "node:http";
import { createConnection } from "node:net";
import { networkInterfaces } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { kPatience, picture, shown, Stage, until } from "./stage.mjs";

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
  await until(page, () => Number(document.getElementById("stage").dataset.vertices) > 900);
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
});

// --- whom it lets see it

function get(port, options) {
  return new Promise((resolve, reject) => {
    const request = http.request({ host: "127.0.0.1", port, ...options });
    const done = (response) => {
      response.resume?.();
      resolve({ status: response.statusCode, headers: response.headers });
    };
    request.on("response", done);
    request.on("upgrade", (response, socket) => {
      socket.destroy();
      done(response);
    });
    request.on("error", reject);
    request.end();
  });
}

const upgrade = (port, path, origin) => ({
  path,
  headers: {
    Connection: "Upgrade",
    Upgrade: "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    Host: `127.0.0.1:${port}`,
    ...(origin ? { Origin: origin } : {}),
  },
});

test("others are turned away", async () => {
  const { port } = await stage.gateway();
  const ours = `http://127.0.0.1:${port}`;
  const page = await get(port, { path: "/" });
  assert.equal(page.status, 200);
  assert.match(page.headers["content-security-policy"], /default-src 'none'/);
  assert.equal((await get(port, { path: "/../etc/passwd" })).status, 404);
  assert.equal((await get(port, { path: "/", method: "POST" })).status, 405);
  assert.equal(
    (await get(port, { path: "/", headers: { Host: `localhost:${port}` } })).status,
    200,
  );
  for (const host of ["evil.example", `evil.example:${port}`, "127.0.0.1", "127.0.0.1:1"]) {
    assert.equal((await get(port, { path: "/", headers: { Host: host } })).status, 421, host);
  }
  assert.equal((await get(port, upgrade(port, "/call/GetMesh", ours))).status, 101);
  for (const origin of [
    undefined,
    "null",
    "http://evil.example",
    `https://127.0.0.1:${port}`,
    "http://127.0.0.1:1",
    `http://localhost:${port}`,
  ]) {
    assert.equal(
      (await get(port, upgrade(port, "/call/GetMesh", origin))).status,
      403,
      `${origin}`,
    );
  }
  for (const call of ["/call/CreateMesh", "/call/DeleteMesh", "/call/", "/call/../GetMesh", "/"]) {
    assert.equal((await get(port, upgrade(port, call, ours))).status, 404, call);
  }
  const huge = get(port, {
    path: "/",
    headers: { "X-Long": "x".repeat(15_000), "X-Longer": "y".repeat(15_000) },
  });
  await assert.rejects(huge, "headers without end are not waited for");

  // Nobody from another machine: this one's other addresses do not listen.
  const elsewhere = Object.values(networkInterfaces())
    .flat()
    .find((a) => a.family === "IPv4" && !a.internal);
  if (elsewhere) {
    await assert.rejects(
      new Promise((resolve, reject) => {
        const socket = createConnection({ host: elsewhere.address, port: Number(port) });
        socket.on("connect", resolve).on("error", reject);
      }),
      { code: "ECONNREFUSED" },
    );
  }
});

test("whoever does not know the secret sees nothing", async () => {
  const { port } = await stage.gateway();
  const page = await stage.page(`http://127.0.0.1:${port}/#${"0".repeat(32)}`);
  await until(
    page,
    () =>
      document.getElementById("connection").textContent.includes("not good here") ||
      document.getElementById("connection").textContent.includes("no longer"),
  );
  assert.equal(await page.locator("#list button").count(), 0);
  await page.close();

  // And an impostor is told nothing: no name of a mesh, no request.
  const impostor = await Impostor.open(port);
  const deceived = await stage.page(`http://127.0.0.1:${impostor.port}/#${"0".repeat(32)}`);
  await until(deceived, () =>
    document.getElementById("connection").textContent.includes("another program"),
  );
  assert.ok(impostor.heard.length > 0);
  for (const frame of impostor.heard) assert.match(frame, /^[0-9a-f]{64} [0-9a-f]{32}$/);
  await deceived.close();
  impostor.server.closeAllConnections();
  impostor.server.close();
});

// Serves the same page, and answers its calls without knowing the secret.
class Impostor {
  heard = [];

  static async open(port) {
    const impostor = new Impostor();
    impostor.server = http.createServer((_, response) => {
      http.get({ host: "127.0.0.1", port }, (page) => page.pipe(response));
    });
    impostor.server.on("upgrade", (request, socket) => impostor.meet(request, socket));
    await new Promise((resolve) => impostor.server.listen(0, "127.0.0.1", resolve));
    impostor.port = impostor.server.address().port;
    return impostor;
  }

  meet(request, socket) {
    const key = request.headers["sec-websocket-key"] + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
    const accept = createHash("sha1").update(key).digest("base64");
    socket.on("error", () => {});
    socket.write(
      "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n" +
        `Sec-WebSocket-Accept: ${accept}\r\n\r\n`,
    );
    const say = (text) =>
      socket.write(Buffer.concat([Buffer.from([0x81, text.length]), Buffer.from(text)]));
    say(JSON.stringify({ nonce: "1".repeat(32) }));
    socket.on("data", (frame) => {
      if ((frame[0] & 15) !== 1) return;
      // A short text, masked: its length, four bytes of mask, the text.
      const mask = frame.subarray(2, 6);
      const body = frame.subarray(6, 6 + (frame[1] & 127)).map((byte, i) => byte ^ mask[i % 4]);
      this.heard.push(Buffer.from(body).toString());
      say(JSON.stringify({ proof: "2".repeat(64) }));
    });
  }
}
