// Writes the types of the protocol's messages to src/generated and its files to dist/proto, from
// where they are loaded at run time; and what all clients share of the doctor.
import { execFileSync } from "node:child_process";
import { cpSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";

const at = (path) => fileURLToPath(new URL(path, import.meta.url));
const protos = at("../../../proto");

rmSync(at("../src/generated"), { recursive: true, force: true });
execFileSync(
  process.execPath,
  [
    at("../node_modules/@grpc/proto-loader/build/bin/proto-loader-gen-types.js"),
    "--longs=Number",
    "--enums=String",
    "--defaults",
    "--oneofs",
    "--arrays",
    "--targetFileExtension=.ts",
    "--importFileExtension=.js",
    "--grpcLib=@grpc/grpc-js",
    `--includeDirs=${protos}`,
    `--outDir=${at("../src/generated")}`,
    "stellate/v1/stellate.proto",
    "stellate/v1/doctor.proto",
    "stellate/v1/errors.proto",
    "stellate/rpc/status_details.proto",
  ],
  { stdio: ["ignore", "ignore", "inherit"], cwd: protos },
);
cpSync(`${protos}/stellate`, at("../dist/proto/stellate"), { recursive: true });

const table = readFileSync(at("../../shared/doctor.toml"), "utf8");
const numbers = [...table.matchAll(/^(\w+) = (-?[0-9][^\s#]*)/gm)].map(
  (row) => `  ${row[1]}: ${row[2]},`,
);
writeFileSync(
  at("../src/generated/numbers.ts"),
  `/** The numbers of clients/shared/doctor.toml. */\nexport const DOCTOR = {\n${numbers.join("\n")}\n};\n`,
);
