// A directory in which one mesh outlives the processes that make it:
//   mesh     the mesh's name on the private server, and, on the next line, what is meshed
//   server/  that server's --data-dir
import { existsSync, mkdirSync, readFileSync, renameSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { setTimeout as sleep } from "node:timers/promises";
import type { Client } from "./client.js";
import { FailedPrecondition, InvalidArgument, StellateError } from "./errors.js";
import type { MeshSpec } from "./generated/stellate/v1/MeshSpec.js";
import type { MeshInfo } from "./report.js";
import { Server } from "./server.js";
import { Stub } from "./wire.js";

const LAST_SERVER = 20_000; // milliseconds that the server of a killed process may take to end

export class Checkpoint {
  private readonly record: string;

  constructor(readonly folder: string) {
    this.record = join(folder, "mesh");
  }

  /** Starts the private server, once that of a killed process has come to its end. */
  async server(): Promise<Server> {
    if (existsSync(join(this.folder, "mesh.json"))) {
      throw new InvalidArgument(
        `${this.folder} is a checkpoint of the Python client: take another directory`,
      );
    }
    mkdirSync(this.folder, { recursive: true, mode: 0o700 });
    const data = join(this.folder, "server");
    const flags = ["--data-dir", data, "--keep-finished-seconds", "31536000"];
    for (const deadline = Date.now() + LAST_SERVER; ; await sleep(100)) {
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

  /** The mesh that is there, or a new one. */
  async declare(client: Client, spec: MeshSpec): Promise<MeshInfo> {
    const essence = { spec: { ...spec, label: "" } };
    const wanted = Buffer.from(Stub.service.CreateMesh.requestSerialize(essence));
    const kept = existsSync(this.record) ? readFileSync(this.record) : Buffer.alloc(0);
    const end = kept.indexOf("\n");
    const name = kept.subarray(0, Math.max(0, end)).toString();
    if (name && !kept.subarray(end + 1).equals(wanted)) {
      throw new InvalidArgument(
        `the checkpoint ${this.folder} is of a mesh of another specification: ` +
          "take another directory, or remove it",
      );
    }
    let found: MeshInfo | undefined;
    for await (const info of client.list()) {
      if (info.name === name) found = info;
      else await client.delete(info.name); // was forgotten, or never put down
    }
    if (found) return found;
    found = await client.createFrom(spec);
    writeFileSync(`${this.record}.new`, Buffer.concat([Buffer.from(`${found.name}\n`), wanted]));
    renameSync(`${this.record}.new`, this.record); // all of it or nothing
    return found;
  }

  /** Has the next call begin anew where this mesh has failed for good. */
  forgetAfter(error: unknown): void {
    const over = error instanceof StellateError && error.mesh?.report !== undefined;
    // With more room for its journal it would go on.
    if (over && !error.reason.startsWith("JOURNAL_")) rmSync(this.record, { force: true });
  }
}
