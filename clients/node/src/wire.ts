// The protocol: its service, its arrays, and the details of its errors.
import { readFileSync } from "node:fs";
import { endianness } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import * as grpc from "@grpc/grpc-js";
import { type EnumTypeDefinition, loadSync, type MessageTypeDefinition } from "@grpc/proto-loader";
import protobuf from "protobufjs";
import type { ProtoGrpcType } from "./generated/stellate.js";
import type { Array as WireArray } from "./generated/stellate/v1/Array.js";
import type { MeshSpec, MeshSpec__Output } from "./generated/stellate/v1/MeshSpec.js";
import type { StellateClient } from "./generated/stellate/v1/Stellate.js";

if (endianness() !== "LE") throw new Error("stellate needs a little-endian machine");

const folder = join(dirname(fileURLToPath(import.meta.url)), "..", "proto");
const proto = loadSync("stellate/v1/stellate.proto", {
  includeDirs: [folder],
  longs: Number,
  enums: String,
  defaults: true,
  arrays: true,
  oneofs: true,
});

const services: unknown = grpc.loadPackageDefinition(proto);

/** The service's stub. Enumerators that this version does not know are numbers, not errors. */
export const Stub = (services as ProtoGrpcType).stellate.v1.Stellate;
export type Stub = StellateClient;

/** A specification as the protocol's bytes, and back. */
export const SpecBytes = proto["stellate.v1.MeshSpec"] as MessageTypeDefinition<
  MeshSpec,
  MeshSpec__Output
>;

const place = (proto["stellate.v1.Place"] as EnumTypeDefinition).type as {
  value: { number: number; name: string }[];
};
/** The names of the protocol's Place, by their numbers. */
export const PLACES: ReadonlyMap<number, string> = new Map(
  place.value.map(({ number, name }) => [number, name]),
);

const details = protobuf.parse(
  readFileSync(join(folder, "stellate/rpc/status_details.proto"), "utf8"),
).root;
details.addJSON(protobuf.common.get("google/protobuf/any.proto")?.nested ?? {});

/** A message of status_details.proto as a plain object. */
export function decodeDetail(type: string, bytes: Uint8Array): Record<string, unknown> {
  const message = details.lookupType(`stellate.rpc.${type}`);
  return message.toObject(message.decode(bytes), { defaults: true, bytes: Buffer });
}

/** An enumerator without its prefix; "UNKNOWN" for one of a newer server. */
export function enumName(value: string | number, prefix: string): string {
  if (typeof value !== "string") return "UNKNOWN";
  return value.startsWith(prefix) ? value.slice(prefix.length) : value;
}

type Received = { shape: number[]; data: Buffer | Uint8Array } | null | undefined;

function bytesOf(array: Received, shape: number[], width: number): [ArrayBuffer, number] {
  const given = array?.shape ?? [0, ...shape.slice(1)];
  const data = array?.data ?? new Uint8Array();
  const fits =
    given.length === shape.length && shape.every((extent, i) => extent < 0 || given[i] === extent);
  const count = given.reduce((product, extent) => product * extent, 1);
  if (!fits || data.byteLength !== count * width) {
    throw new RangeError(
      `an array of shape [${given.join(", ")}] and ${data.byteLength} bytes came, ` +
        `not one of shape [${shape.map((n) => (n < 0 ? "n" : n)).join(", ")}]`,
    );
  }
  // A copy, as what comes off the wire is not aligned.
  const start = data.byteOffset;
  return [data.buffer.slice(start, start + data.byteLength) as ArrayBuffer, given[0]];
}

/** The numbers of an array of that shape, -1 standing for any extent. Throws RangeError. */
export function numbers(array: Received, ...shape: number[]): Float64Array {
  return new Float64Array(bytesOf(array, shape, 8)[0]);
}

/** The same for vertex numbers. */
export function indices(array: Received, ...shape: number[]): Uint32Array {
  return new Uint32Array(bytesOf(array, shape, 4)[0]);
}

/** For sending; the numbers are not copied. */
export function toWire(values: Float64Array, ...shape: number[]): WireArray {
  return { shape, data: Buffer.from(values.buffer, values.byteOffset, values.byteLength) };
}

export { grpc };
