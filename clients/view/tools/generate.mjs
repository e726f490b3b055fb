// Writes TypeScript for the protocol's messages to src/generated, with protoc and the plugin that
// the lock file names.
import { execFileSync } from "node:child_process";
import { mkdirSync, rmSync } from "node:fs";
import { fileURLToPath } from "node:url";

const at = (path) => fileURLToPath(new URL(path, import.meta.url));
const out = at("../src/generated");

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
execFileSync(
  "protoc",
  [
    `--plugin=${at("../node_modules/.bin/protoc-gen-es")}`,
    `--es_out=${out}`,
    "--es_opt=target=ts",
    `-I${process.env.STELLATE_PROTO ?? at("../../../proto")}`,
    "stellate/v1/geometry.proto",
    "stellate/v1/oracle.proto",
    "stellate/v1/mesh.proto",
    "stellate/v1/doctor.proto",
    "stellate/v1/stellate.proto",
  ],
  { stdio: "inherit" },
);
