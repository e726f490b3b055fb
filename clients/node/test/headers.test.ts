import assert from "node:assert/strict";
import { test } from "node:test";
import * as stellate from "../src/index.js";
import { grpc, Stub } from "../src/wire.js";

test("headers go with each call, asked for anew", async () => {
  const seen: string[] = [];
  const server = new grpc.Server();
  const heard = (call: { metadata: grpc.Metadata }) => {
    seen.push(...call.metadata.get("traceparent").map(String));
    return { code: grpc.status.PERMISSION_DENIED, details: "a server that only listens" };
  };
  server.addService(Stub.service, {
    GetServerInfo: (
      call: grpc.ServerUnaryCall<object, object>,
      reply: grpc.sendUnaryData<object>,
    ) => reply(heard(call)),
    ServeOracle: (call: grpc.ServerDuplexStream<object, object>) => call.emit("error", heard(call)),
  });
  const port = await new Promise<number>((bound, failed) =>
    server.bindAsync("127.0.0.1:0", grpc.ServerCredentials.createInsecure(), (error, at) =>
      error ? failed(error) : bound(at),
    ),
  );
  let calls = 0;
  const client = new stellate.Client(`127.0.0.1:${port}`, {
    headers: () => ({
      traceparent: `00-${"4b".repeat(16)}-${String(++calls).padStart(16, "0")}-01`,
    }),
  });
  try {
    await assert.rejects(client.info());
    await assert.rejects(client.serve(new stellate.Torus(), `meshes/${"0".repeat(32)}`));
  } finally {
    client.close();
    server.forceShutdown();
  }
  assert.deepEqual(
    seen.map((parent) => parent.slice(48, 52)),
    ["0001", "0002"],
  );
});
