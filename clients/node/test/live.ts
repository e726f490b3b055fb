// What the tests share: servers, and how large the meshes have to be.
import assert from "node:assert/strict";
import { type ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { createInterface } from "node:readline";

export function fromEnvironment(name: string): string {
  const value = process.env[name];
  assert(value, `tests/languages/run sets ${name}`);
  return value;
}

/** Vertices and simplices of the torus, and of the Clifford torus, as the Python client has them. */
export const [torusCounts, cliffordCounts] = (() => {
  const all = fromEnvironment("STELLATE_TEST_COUNTS").trim().split(" ").map(Number);
  return [all.slice(0, 2), all.slice(2, 4)];
})();

/** A server that can be killed and started again. */
export class RestartingServer {
  private constructor(
    readonly address: string,
    private readonly child: ChildProcess,
  ) {}

  static async start(...flags: string[]): Promise<RestartingServer> {
    const child = spawn(fromEnvironment("STELLATE_TEST_RESTARTING_SERVER"), flags, {
      stdio: ["pipe", "pipe", "inherit"],
    });
    const [address] = (await once(createInterface(child.stdout), "line")) as [string];
    return new RestartingServer(address, child);
  }

  restart(): void {
    this.child.stdin?.write("\n");
  }

  async close(): Promise<void> {
    this.child.stdin?.end();
    await once(this.child, "exit");
  }
}
