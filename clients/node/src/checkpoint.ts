// A directory in which one mesh outlives the processes that make it: clients/shared/checkpoint.toml.
import {
  closeSync,
  constants,
  existsSync,
  fstatSync,
  lstatSync,
  mkdirSync,
  openSync,
  readFileSync,
  renameSync,
  rmSync,
  writeFileSync,
} from "node:fs";
import { join } from "node:path";
import { setTimeout as sleep } from "node:timers/promises";
import type { Client } from "./client.js";
import { FailedPrecondition, InvalidArgument, StellateError } from "./errors.js";
import type { Choice } from "./epsilon.js";
import { CHECKPOINT } from "./generated/shared.js";
import type { MeshSpec } from "./generated/stellate/v1/MeshSpec.js";
import type { MeshInfo } from "./report.js";
import { Server } from "./server.js";
import { SpecBytes } from "./wire.js";

export class Checkpoint {
  readonly folder: string;
  private readonly record: string;

  constructor(folder: string) {
    this.folder = folder.replace(/(?<=.)\/+$/, ""); // "link/" would be followed
    this.record = join(this.folder, CHECKPOINT.record);
  }

  /** Starts the private server, once that of a killed process has come to its end. */
  async server(): Promise<Server> {
    mkdirSync(this.folder, { recursive: true, mode: 0o700 });
    insistOnOwn(this.folder);
    if (existsSync(join(this.folder, CHECKPOINT.python_record))) {
      throw new InvalidArgument(
        `${this.folder} is a checkpoint of the Python client: take another directory`,
      );
    }
    const data = join(this.folder, CHECKPOINT.server);
    const kept = String(CHECKPOINT.keep_finished_seconds);
    const flags = ["--data-dir", data, "--keep-finished-seconds", kept];
    for (const deadline = Date.now() + 1000 * CHECKPOINT.last_server_seconds; ; await sleep(100)) {
      try {
        return await Server.start({ flags });
      } catch (error) {
        if (!String(error).includes("another server uses")) throw error;
        if (Date.now() < deadline) continue;
        throw new FailedPrecondition(
          `another process is meshing in the checkpoint ${this.folder}: wait for its end, ` +
            "or take another directory",
        );
      }
    }
  }

  /** The epsilon that was chosen for the mesh that is there; undefined: none was. */
  choice(): Choice | undefined {
    const { retries, reason, spec } = this.read();
    if (!reason) return undefined;
    const { epsilon } = SpecBytes.deserialize(spec);
    return { epsilon, reason, retries };
  }

  /** The mesh that is there, or a new one; with `again` a new one in its place. */
  async declare(
    client: Client,
    spec: MeshSpec,
    { retries, reason }: Choice,
    again: boolean,
  ): Promise<MeshInfo> {
    const wanted = SpecBytes.serialize({ ...spec, label: "" });
    const { name, spec: kept } = this.read();
    if (name && !again && !saying(kept).equals(saying(wanted))) {
      throw new InvalidArgument(
        `the checkpoint ${this.folder} is of a mesh of another specification: ` +
          "take another directory, or remove it",
      );
    }
    let found: MeshInfo | undefined;
    for await (const info of client.list()) {
      if (info.name === name && !again) found = info;
      else if (info.name !== name) await client.delete(info.name); // forgotten, or never put down
    }
    if (found) return found;
    found = await client.createFrom(spec);
    const draft = join(this.folder, CHECKPOINT.draft);
    rmSync(draft, { force: true }); // of a process that was killed; a link itself, not where it leads
    const first = [found.name, ...(reason ? [retries, reason] : [])].join(" ");
    const all = Buffer.concat([Buffer.from(`${first}\n`), wanted]);
    writeFileSync(draft, all, { flag: "wx", mode: 0o600 });
    renameSync(draft, this.record); // all of it or nothing
    if (again) await client.delete(name);
    return found;
  }

  /** What was put down; the name is "" where nothing was. */
  private read() {
    const kept = readOwn(this.record);
    const end = kept.indexOf("\n");
    const first = kept.subarray(0, Math.max(0, end)).toString();
    const [, name = "", retries, reason = ""] = /^(\S*)(?: (\d+) (.*))?$/.exec(first) ?? [];
    return { name, retries: Number(retries ?? 0), reason, spec: kept.subarray(end + 1) };
  }

  /** Has the next call begin from the start where this mesh has failed for good. */
  forgetAfter(error: unknown): void {
    const over = error instanceof StellateError && error.mesh?.report !== undefined;
    // With more room for its journal it would go on.
    if (over && !error.reason.startsWith("JOURNAL_")) rmSync(this.record, { force: true });
  }
}

/** The same specification, with all that other languages leave out. */
function saying(spec: Buffer): Buffer {
  try {
    return SpecBytes.serialize(SpecBytes.deserialize(spec));
  } catch {
    return spec; // which is none
  }
}

/** Throws InvalidArgument where others could have put there what we would believe. */
function insistOnOwn(folder: string): void {
  const found = lstatSync(folder);
  const wrong = (what: string) => new InvalidArgument(`the checkpoint ${folder} ${what}`);
  if (found.isSymbolicLink()) throw wrong("is a link: name the directory that it leads to");
  if (process.geteuid === undefined) return; // a system without owners and modes
  if (found.uid !== process.geteuid()) {
    throw wrong(`belongs to another user, of number ${found.uid}: take another directory`);
  }
  if ((found.mode & 0o022) !== 0) {
    throw wrong(
      `may be written by others (mode ${(found.mode & 0o7777).toString(8)}): ` +
        "take another directory, or, if all in it is yours, chmod go-w",
    );
  }
}

/** A file of this user's, no link; empty if there is none. */
function readOwn(path: string): Buffer {
  const problem = `${path} is a link, or no file of this user's: take another directory`;
  // NONBLOCK: a pipe without another end would wait for it. Both are missing on Windows.
  const { O_RDONLY, O_NOFOLLOW = 0, O_NONBLOCK = 0 } = constants;
  let file: number;
  try {
    file = openSync(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
  } catch (error) {
    const code = (error as NodeJS.ErrnoException).code;
    if (code === "ENOENT") return Buffer.alloc(0);
    if (code === "ELOOP") throw new InvalidArgument(problem);
    throw error;
  }
  try {
    const found = fstatSync(file);
    const own = process.geteuid === undefined || found.uid === process.geteuid();
    if (!found.isFile() || !own) throw new InvalidArgument(problem);
    return readFileSync(file);
  } finally {
    closeSync(file);
  }
}
