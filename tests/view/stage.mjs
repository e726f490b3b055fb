// What the viewer's tests stand on: a server of meshes, its gateways, a browser.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { after, afterEach, before } from "node:test";
import { fileURLToPath } from "node:url";

// From where the page was built: one lock file names all that comes from npm.
const require = createRequire(join(process.env.STELLATE_VIEW_WORK, "package.json"));
const { chromium } = require("playwright-core");

// With a thing that takes a second on a machine with nothing else to do.
export const kPatience = 180_000;
const here = fileURLToPath(new URL(".", import.meta.url));

// For all tests of a file. What each of them opened is closed behind it, and must not have failed.
export function setStage() {
  const stage = new Stage();
  before(() => stage.open(), { timeout: kPatience });
  afterEach(() => stage.clear());
  after(() => stage.close());
  return stage;
}

export class Stage {
  children = [];
  pages = [];

  async open() {
    this.folder = mkdtempSync(join(tmpdir(), "stellate-view-"));
    this.address = `unix:${this.folder}/server`;
    const ready = join(this.folder, "ready");
    const server = this.spawn(process.env.STELLATED, [
      "--listen",
      this.address,
      "--exit-with-parent",
      "--data-dir",
      join(this.folder, "data"),
      "--ready-file",
      ready,
    ]);
    server.stderr.resume();
    const failed = once(server, "exit").then(() => Promise.reject(new Error("no server")));
    const listens = (async () => {
      while (!existsSync(ready)) await new Promise((resolve) => setTimeout(resolve, 20));
    })();
    failed.catch(() => {}); // it is stopped in the end
    await Promise.race([listens, failed]);
    this.serve();
    this.browser = await chromium.launch({
      executablePath: process.env.CHROMIUM,
      args: ["--no-sandbox"],
      timeout: kPatience,
    });
  }

  serve() {
    this.meshes = this.spawn("/usr/bin/python3", [join(here, "meshes.py"), this.address]);
    this.said = createInterface(this.meshes.stdout)[Symbol.asyncIterator]();
    this.meshes.stderr.pipe(process.stderr);
    this.serves = false; // one of them
  }

  spawn(program, args) {
    const env = { ...process.env, XDG_RUNTIME_DIR: this.folder, BROWSER: "" };
    delete env.DISPLAY;
    delete env.WAYLAND_DISPLAY;
    const child = spawn(program, args, { env });
    this.children.push(child);
    return child;
  }

  // Declares a mesh and, unless it waits for begin(), waits for its end. Its name.
  async mesh(wish) {
    this.serves = true;
    this.meshes.stdin.write(JSON.stringify(wish) + "\n");
    const { value: name } = await this.said.next();
    if (!wish.wait && wish.hold === undefined) await this.over();
    return name;
  }
  begin() {
    this.meshes.stdin.write("\n");
  }
  async over() {
    const { value } = await this.said.next();
    if (value !== "over") throw new Error(`the mesh is not over: ${value}`);
    this.serves = false;
  }

  // `stellate view ...`, and the address that it prints.
  gateway(...args) {
    return this.viewer("--server", this.address, ...args);
  }
  async viewer(...args) {
    const process_ = this.spawn(process.env.STELLATE, ["view", "--no-browser", ...args]);
    const said = [];
    process_.stderr.on("data", (text) => said.push(text));
    const ended = once(process_, "exit");
    const line = once(createInterface(process_.stdout), "line");
    const first = await Promise.race([line, ended.then(() => null)]);
    if (first === null) throw new Error(`no gateway: ${said.join("")}`);
    const url = new URL(first[0]);
    return { process: process_, url: url.href, port: url.port, secret: url.hash.slice(1), ended };
  }

  async page(url, script = () => {}, moves = false) {
    // Meshes in more than three dimensions would turn by themselves.
    const reducedMotion = moves ? "no-preference" : "reduce";
    const viewport = { width: 1200, height: 760 };
    const page = await this.browser.newPage({ viewport, reducedMotion });
    this.pages.push(page);
    page.requested = [];
    page.sockets = [];
    page.said = [];
    page.faults = [];
    page.on("request", (request) => page.requested.push(request.url()));
    page.on("websocket", (socket) => {
      page.sockets.push(socket);
      page.requested.push(socket.url());
    });
    page.on("console", (line) => page.said.push(line.text()));
    page.on("pageerror", (error) => page.faults.push(error.message));
    page.setDefaultTimeout(kPatience);
    await page.addInitScript(lookOn);
    await page.addInitScript(script);
    await page.goto(url);
    return page;
  }

  // A page with a gateway of its own: to that mesh, if there is one.
  async look(name, script, moves) {
    const gateway = await this.gateway(...(name ? [name] : []));
    const page = await this.page(gateway.url, script, moves);
    return Object.assign(page, { gateway });
  }

  async clear() {
    const pages = this.pages.splice(0);
    await Promise.all(pages.map((page) => page.close()));
    if (this.serves) {
      this.meshes.kill("SIGKILL"); // a test that failed left it there
      this.serve();
    }
    assert.deepEqual(
      pages.flatMap(({ faults }) => faults),
      [],
    );
  }

  async close() {
    await this.browser?.close();
    for (const child of this.children) child.kill("SIGKILL");
    rmSync(this.folder, { recursive: true, force: true });
  }
}

// That nobody listens on, nor is given for the asking: those begin above it.
export async function freePort() {
  for (let port = 20_000 + (process.pid % 10_000); port < 32_000; port++) {
    const server = createServer();
    const listens = new Promise((resolve) => {
      server.once("listening", () => resolve(true)).once("error", () => resolve(false));
    });
    server.listen(port, "127.0.0.1");
    if (!(await listens)) continue;
    await new Promise((resolve) => server.close(resolve));
    return port;
  }
  throw new Error("no port is free");
}

// In the page: what its canvas shows now. How much of it is no background, in how many parts, how many
// colours, a digest by which two pictures are told apart, the sides of what is seen, how far down it
// comes, 0 to 1; and of what mesh that is, as the page says.
function lookOn() {
  window.hues = () => {
    const canvas = document.getElementById("canvas");
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    let [blue, yellow] = [0, 0];
    for (let i = 0; i < data.length; i += 4) {
      const [r, , b] = data.subarray(i, i + 3);
      if (b > r + 30) blue++;
      if (r > b + 50) yellow++;
    }
    const all = data.length / 4;
    return { blue: blue / all, yellow: yellow / all };
  };
  window.glance = () => {
    const canvas = document.getElementById("canvas");
    const [width, height] = [200, Math.round((200 * canvas.height) / canvas.width)];
    const copy = new OffscreenCanvas(width, height).getContext("2d");
    copy.drawImage(canvas, 0, 0, width, height);
    const { data } = copy.getImageData(0, 0, width, height);
    const word = (i) => (data[4 * i] << 16) | (data[4 * i + 1] << 8) | data[4 * i + 2];
    const back = word(0);
    const near = (a, b) =>
      [16, 8, 0].every((shift) => Math.abs(((a >> shift) & 255) - ((b >> shift) & 255)) < 12);
    const ink = Array.from({ length: width * height }, (_, i) => !near(word(i), back));
    const seen = new Uint8Array(ink.length);
    let parts = 0;
    for (let start = 0; start < ink.length; start++) {
      if (!ink[start] || seen[start]) continue;
      let size = 0;
      const stack = [start];
      seen[start] = 1;
      while (stack.length > 0) {
        const i = stack.pop();
        size++;
        for (const j of [i - 1, i + 1, i - width, i + width]) {
          if (j < 0 || j >= ink.length || !ink[j] || seen[j]) continue;
          if (Math.abs((i % width) - (j % width)) > 1) continue;
          seen[j] = 1;
          stack.push(j);
        }
      }
      if (size > 20) parts++;
    }
    let digest = 0;
    for (let i = 0; i < ink.length; i++) digest = (Math.imul(digest, 31) + word(i)) | 0;
    const lines = [...ink.keys()].filter((i) => ink[i]);
    const side = (of) =>
      lines.length > 0 ? Math.max(...lines.map(of)) - Math.min(...lines.map(of)) + 1 : 0;
    const sides = [side((i) => i % width), side((i) => Math.floor(i / width))];
    const lowest = Math.ceil((ink.lastIndexOf(true) + 1) / width) / height;
    const colours = new Set(ink.flatMap((on, i) => (on ? [word(i)] : []))).size;
    const share = ink.filter(Boolean).length / ink.length;
    const { dataset } = document.getElementById("stage");
    const [revision, vertices, simplices] = ["revision", "vertices", "simplices"].map((name) =>
      Number(dataset[name]),
    );
    const ground = [...data.subarray(0, 3)];
    return { ground, share, parts, colours, digest, sides, lowest, revision, vertices, simplices };
  };
}

// Shares of the canvas that are blue and that are yellow or orange, once what was asked for is there.
export async function hues(page) {
  await still(page);
  return page.evaluate(() => window.hues());
}

// Of what moves by itself.
export const glance = (page) => page.evaluate(() => window.glance());

// Of what was asked for, once it is there.
export async function picture(page) {
  await still(page);
  return glance(page);
}

// Waits until all that was asked for is on the screen, and stays: a window's new size takes a frame to
// be seen, and one to be drawn.
export async function still(page) {
  await page.evaluate(() => (window.framesStill = 0));
  await page.waitForFunction(
    () => {
      const busy = document.getElementById("stage").ariaBusy !== "false";
      return (window.framesStill = busy ? 0 : window.framesStill + 1) > 3;
    },
    undefined,
    { timeout: kPatience, polling: "raf" },
  );
}

// Waits until the mesh that is looked at is over, and all of it on the screen.
export async function finished(page) {
  await until(page, () => {
    const newest = document.getElementById("revision").max;
    const over = document.querySelector("#verdict .headline") !== null;
    return over && document.getElementById("stage").dataset.revision === newest;
  });
  await still(page);
}

export async function resize(page, width, height) {
  await page.setViewportSize({ width, height });
  await until(page, (size) => `${[innerWidth, innerHeight]}` === `${size}`, [width, height]);
}

export const shown = (page) =>
  page.evaluate(() => {
    const { revision, vertices, simplices } = document.getElementById("stage").dataset;
    return { revision: Number(revision), vertices: Number(vertices), simplices: Number(simplices) };
  });

// Waits until something holds in the page, or in a frame of it.
export function until(page, holds, argument) {
  return page.waitForFunction(holds, argument, { timeout: kPatience, polling: 100 });
}
