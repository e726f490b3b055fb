// For every line "EPSILON" on standard input meshes the torus and prints "SECONDS VERTICES SIMPLICES".
//
// Usage: node dist/examples/timing.js SERVER
import { createInterface } from "node:readline";
import { Client, mesh, Torus } from "../src/index.js";

const client = new Client(process.argv[2]);
for await (const epsilon of createInterface(process.stdin)) {
  const begin = performance.now();
  const torus = await mesh(new Torus(), { epsilon: Number(epsilon), server: client });
  const seconds = (performance.now() - begin) / 1000;
  console.log(`${seconds} ${torus.vertexCount} ${torus.simplexCount}`);
}
client.close();
