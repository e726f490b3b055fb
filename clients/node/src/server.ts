// A stellated of one's own: found, started, and stopped.
import { type ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { accessSync, constants, existsSync, mkdtempSync, readdirSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { delimiter, dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { ServerNotFound, StellateError, Unavailable } from "./errors.js";

const STOP_MILLISECONDS = 10_000;
const SAID = /^stellated listening on (.*)$/;
// When its client goes no client is left to finish a mesh for. One that answers no pings is
// merely busy in an oracle that does not let go of the event loop.
const OWN_FLAGS = ["--drain-seconds", "0"];
const PRIVATE_FLAGS = ["--keepalive", "600", "--keepalive-timeout", "600"];

function runs(path: string): boolean {
  try {
    accessSync(path, constants.X_OK);
    return true;
  } catch {
    return false;
  }
}

function inSourceTree(): string[] {
  let folder = dirname(fileURLToPath(import.meta.url));
  while (!existsSync(join(folder, "clients", "node", "package.json"))) {
    if (folder === dirname(folder)) return [];
    folder = dirname(folder);
  }
  const build = join(folder, "build");
  const names = existsSync(build) ? readdirSync(build) : [];
  names.sort((a, b) => Number(b === "release") - Number(a === "release"));
  return names.map((name) => join(build, name, "bin", "stellated"));
}

/** Of the package that carries a server for this machine, where it is installed. */
function inPackage(): string[] {
  const name = `stellate-server-${process.platform}-${process.arch}`;
  try {
    const manifest = createRequire(import.meta.url).resolve(`${name}/package.json`);
    return [join(dirname(manifest), "bin", "stellated")];
  } catch {
    return [];
  }
}

/**
 * The server binary: $STELLATED, else that of the package stellate-server-PLATFORM-PROCESSOR, else
 * build/ of the source tree, else PATH.
 */
export function findStellated(): string {
  const named = process.env.STELLATED;
  const folders = (process.env.PATH ?? "").split(delimiter);
  const onPath = (name: string) => folders.map((folder) => join(folder, name));
  if (named) {
    const path = [named, ...(named.includes("/") ? [] : onPath(named))].find(runs);
    if (path) return path;
    throw new ServerNotFound(`$STELLATED is ${named}, which is not a program that can be run`);
  }
  const path = [...inPackage(), ...inSourceTree(), ...onPath("stellated")].find(runs);
  if (path) return path;
  throw new ServerNotFound(
    "no server was given and no stellated found to start: pass server: 'host:port', or set " +
      "$STELLATED to the binary, or put it on PATH, or build it (clients/quickstart does), or " +
      `install stellate-server-${process.platform}-${process.arch} (packaging/npm-server makes it)`,
  );
}

/** A stellated of this process's own, which ends with it whatever happens. */
export class Server {
  private words = "";

  private constructor(
    /** Where clients reach it, "unix:/path" or "host:port". */
    readonly address: string,
    private readonly child: ChildProcess,
    private readonly folder: string,
  ) {}

  /**
   * Starts it, and returns when it listens: on a unix socket that only this user may enter, or at
   * `listen`. `flags` are more of stellated's, e.g. "--data-dir", "meshes".
   */
  static async start({ flags = [] as string[], binary = "", listen = "" } = {}): Promise<Server> {
    const own = [...OWN_FLAGS, ...(listen ? [] : PRIVATE_FLAGS), ...flags];
    return Server.launch(binary || findStellated(), own, listen);
  }

  private static async launch(program: string, flags: string[], listen: string): Promise<Server> {
    const folder = mkdtempSync(join(tmpdir(), "stellate-"));
    const address = listen || `unix:${join(folder, "socket")}`;
    const all = ["--exit-with-parent", "--listen", address, ...flags];
    // A session of its own: Ctrl-C is for the client, which cancels its meshes first.
    const child = spawn(program, all, {
      stdio: ["ignore", "pipe", "pipe"],
      detached: true,
    });
    let words = "";
    child.stderr.on("data", (said: Buffer) => (words = (words + said.toString()).slice(-2000)));
    const listening = new Promise<string>((resolve, reject) => {
      createInterface(child.stdout).on("line", (line) => {
        const at = SAID.exec(line);
        if (at) resolve(at[1]);
      });
      child.once("error", (error) => reject(new ServerNotFound(error.message)));
      child.once("close", (status) => reject(gone(status, words)));
    });
    try {
      const server = new Server(await listening, child, folder);
      child.stderr.on("data", () => (server.words = words));
      // It is no reason for this process to stay.
      child.unref();
      for (const stream of [child.stdout, child.stderr]) (stream as unknown as Unref).unref();
      return server;
    } catch (error) {
      rmSync(folder, { recursive: true, force: true });
      throw error;
    }
  }

  get alive(): boolean {
    return this.child.exitCode === null && this.child.signalCode === null;
  }

  /** With the last words of a server that is no more. */
  whyGone(): StellateError {
    return gone(this.child.exitCode ?? this.child.signalCode, this.words);
  }

  /** Stops it and removes its directory. May be called again. */
  async close(): Promise<void> {
    if (this.alive) {
      this.child.ref();
      const ended = once(this.child, "exit");
      this.child.kill("SIGTERM");
      const timer = setTimeout(() => this.child.kill("SIGKILL"), STOP_MILLISECONDS);
      await ended;
      clearTimeout(timer);
    }
    rmSync(this.folder, { recursive: true, force: true });
  }
}

type Unref = { unref(): void };

function gone(status: number | string | null, words: string): StellateError {
  const said = words.trim();
  return new Unavailable(`stellated ended with ${status}${said ? `:\n${said}` : ""}`, {
    reason: "SERVER_GONE",
  });
}
