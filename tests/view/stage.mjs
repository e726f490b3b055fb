// What the viewer's tests stand on: a server of meshes, its gateways, a browser.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";

// From where the page was built: one lock file names all that comes from npm.
const require = createRequire(join(process.env.STELLATE_VIEW_WORK, "package.json"));
const { chromium } = require("playwright-core");

export const kPatience = 60_000;
const here = fileURLToPath(new URL(".", import.meta.url));

export class Stage {
  static async open() {
    const stage = new Stage();
    stage.folder = mkdtempSync(join(tmpdir(), "stellate-view-"));
    stage.address = `unix:${stage.folder}/server`;
    stage.children = [];
    const ready = join(stage.folder, "ready");
    const server = stage.spawn(process.env.STELLATED, [
      "--listen",
      stage.address,
      "--exit-with-parent",
      "--data-dir",
      join(stage.folder, "data"),
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
    stage.meshes = stage.spawn("/usr/bin/python3", [join(here, "meshes.py"), stage.address]);
    stage.said = createInterface(stage.meshes.stdout)[Symbol.asyncIterator]();
    stage.meshes.stderr.pipe(process.stderr);
    stage.browser = await chromium.launch({
      executablePath: process.env.CHROMIUM,
      args: ["--no-sandbox"],
    });
    return stage;
  }

  spawn(program, args) {
    const env = { ...process.env, XDG_RUNTIME_DIR: this.folder, BROWSER: "" };
    delete env.DISPLAY;
    delete env.WAYLAND_DISPLAY;
    const child = spawn(program, args, { env });
    this.children.push(child);
    return child;
  }

  // Declares a mesh and, unless it is slow or is to wait for begin(), waits for its end. Its name.
  async mesh(wish) {
    this.meshes.stdin.write(JSON.stringify(wish) + "\n");
    const { value: name } = await this.said.next();
    if (!wish.seconds && !wish.wait) await this.over();
    return name;
  }
  begin() {
    this.meshes.stdin.write("\n");
  }
  async over() {
    const { value } = await this.said.next();
    if (value !== "over") throw new Error(`the mesh is not over: ${value}`);
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

  async page(url, script = () => {}) {
    const page = await this.browser.newPage({ viewport: { width: 1200, height: 760 } });
    await page.addInitScript(script);
    page.requested = [];
    page.faults = [];
    page.on("request", (request) => page.requested.push(request.url()));
    page.on("websocket", (socket) => page.requested.push(socket.url()));
    page.on("pageerror", (error) => page.faults.push(error.message));
    page.setDefaultTimeout(kPatience);
    await page.goto(url);
    return page;
  }

  async close() {
    await this.browser?.close();
    for (const child of this.children) child.kill("SIGKILL");
    rmSync(this.folder, { recursive: true, force: true });
  }
}

// What the canvas shows: how much of it is no background, in how many parts, how many colours, and
// a digest by which two pictures are told apart, the sides of what is seen, how far down it comes, 0 to 1.
export function picture(page) {
  return page.evaluate(async () => {
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
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
    const side = (of) => (lines.length > 0 ? Math.max(...lines.map(of)) - Math.min(...lines.map(of)) + 1 : 0);
    const sides = [side((i) => i % width), side((i) => Math.floor(i / width))];
    const lowest = Math.ceil((ink.lastIndexOf(true) + 1) / width) / height;
    const colours = new Set(ink.flatMap((on, i) => (on ? [word(i)] : []))).size;
    return { share: ink.filter(Boolean).length / ink.length, parts, colours, digest, sides, lowest };
  });
}

export const shown = (page) =>
  page.evaluate(() => {
    const { revision, vertices, simplices } = document.getElementById("stage").dataset;
    return { revision: Number(revision), vertices: Number(vertices), simplices: Number(simplices) };
  });

// Waits until what is shown has changed to something for which `holds`.
export function until(page, holds, argument) {
  return page.waitForFunction(holds, argument, { timeout: kPatience, polling: 100 });
}
