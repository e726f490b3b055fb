// Writes the types of the protocol's messages to src/generated and its files to dist/proto, from
// where they are loaded at run time; and the numbers and words that all clients share.
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

const shared = ["auto", "reconnect", "checkpoint"].map((name) => {
  const table = readFileSync(at(`../../shared/${name}.toml`), "utf8");
  const rows = [...table.matchAll(/^(\w+) = ("[^"]*"|-?[0-9][^\s#]*)/gm)];
  const values = rows.map((row) => `  ${row[1]}: ${row[2]},\n`).join("");
  return `/** Of clients/shared/${name}.toml. */\nexport const ${name.toUpperCase()} = {\n${values}};\n`;
});
const retries = JSON.stringify(JSON.parse(readFileSync(at("../../shared/retries.json"), "utf8")));
shared.push(
  `/** clients/shared/retries.json, a service config of gRPC. */\nexport const RETRIES = ${JSON.stringify(retries)};\n`,
);
writeFileSync(at("../src/generated/shared.ts"), shared.join("\n"));
