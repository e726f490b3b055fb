// `stellate view` in a real browser: whom it lets see it.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import http from "node:http";
import { createConnection } from "node:net";
import { networkInterfaces } from "node:os";
import { test } from "node:test";
import { kPatience, setStage, until } from "./stage.mjs";

const stage = setStage();

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

// 300 of them, and as many that have become sockets and show no proof.
test("strangers do not lock us out", async () => {
  const { port, url } = await stage.gateway();
  const ours = `http://127.0.0.1:${port}`;
  const open = [];
  for (let i = 0; i < 300; ++i) {
    const silent = createConnection({ host: "127.0.0.1", port: Number(port) });
    silent.on("error", () => {});
    open.push(silent);
    const socket = createConnection({ host: "127.0.0.1", port: Number(port) });
    socket.on("error", () => {});
    const { path, headers } = upgrade(port, "/call/GetMesh", ours);
    const lines = Object.entries(headers).map(([name, value]) => `${name}: ${value}\r\n`);
    socket.write(`GET ${path} HTTP/1.1\r\n${lines.join("")}\r\n`);
    open.push(socket);
  }
  const page = await stage.page(url);
  // It asks for the list again and again: a call is answered once the page is known.
  await new Promise((resolve, reject) => {
    setTimeout(() => reject(new Error("the page gets no answer")), kPatience).unref();
    page.on("websocket", (socket) =>
      socket.on("framereceived", ({ payload }) => {
        if (String(payload).includes('"proof"')) resolve();
      }),
    );
  });
  assert.equal((await get(port, { path: "/" })).status, 200);
  for (const socket of open) socket.destroy();
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
