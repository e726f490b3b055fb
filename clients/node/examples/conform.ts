// Obeys tests/languages/conform.py: see there.
import { createInterface } from "node:readline";
import { Client, loadTxt, type Mesh, StellateError, Torus, watch } from "../src/index.js";

const client = new Client(process.argv[2], { onOutage: () => {} });

async function obey(command: string, name: string, path: string): Promise<string> {
  let last: Mesh | undefined;
  try {
    if (command === "save") {
      await (await loadTxt(name)).save(path);
      return "saved";
    }
    if (command === "create") await client.create(new Torus(), { epsilon: 1, label: name });
    for await (const grown of watch(name, { server: client })) last = grown;
  } catch (error) {
    if (!(error instanceof StellateError)) throw error;
    if (error.name !== "Cancelled" || !error.mesh) return `error ${error.name} ${error.reason}`;
    last = error.mesh;
  }
  await last?.save(path);
  const report = last?.report;
  return `mesh ${last?.revision} ${report?.termination} ${report?.certificate?.level}`;
}

for await (const line of createInterface(process.stdin)) {
  const [command, name, path] = line.split(" ");
  console.log(await obey(command, name, path));
}
client.close();
