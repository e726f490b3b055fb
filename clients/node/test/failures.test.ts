import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { after, before, test } from "node:test";
import * as stellate from "../src/index.js";
import { fromEnvironment, RestartingServer, torusCounts } from "./live.js";

let server: stellate.Server;
before(async () => {
  server = await stellate.Server.start();
});
after(() => server.close());

class Spoilt extends stellate.Torus {
  private asked = 0;

  constructor(private readonly spoil: (answer: stellate.Found) => stellate.Found) {
    super();
  }

  override closestPoint(x: Float64Array, n: number): stellate.Found {
    const answer = super.closestPoint(x, n);
    this.asked += n;
    return this.asked > 300 ? this.spoil(answer) : answer;
  }
}

const meshed = (oracle: stellate.Oracle, options = {}) =>
  stellate.mesh(oracle, { epsilon: 0.1, server, ...options });

test("what the server refuses names the field", async () => {
  await assert.rejects(meshed(new stellate.Torus(), { epsilon: -1 }), (error) => {
    assert(error instanceof stellate.InvalidArgument);
    assert.equal(error.reason, "INVALID_ARGUMENT");
    return JSON.stringify(error.details.fields).includes("epsilon");
  });
  await assert.rejects(meshed(new stellate.Torus(), { epsilom: 1 }), stellate.InvalidArgument);
  const client = new stellate.Client(server);
  const nobody = `meshes/${"0".repeat(32)}`;
  await assert.rejects(client.get(nobody), stellate.MeshNotFound);
  await assert.rejects(client.serve(new stellate.Torus(), nobody), stellate.MeshNotFound);
  client.close();
});

test("what an oracle throws reaches the caller as itself", async () => {
  const mine = new TypeError("no such surface");
  const oracle = new Spoilt(() => {
    throw mine;
  });
  await assert.rejects(meshed(oracle), (error) => error === mine);
});

test("answers that break a rule are an OracleError with the rule's name", async () => {
  const cases: [string, (answer: stellate.Found) => stellate.Found][] = [
    ["ORACLE_NOT_FINITE", ({ points, found }) => ({ points: points.fill(NaN), found })],
    ["ORACLE_SHAPE", ({ points, found }) => ({ points: points.subarray(1), found })],
    [
      "ORACLE_BAD_TANGENT",
      ({ points, found }) => ({ points: points.map((value) => 1.1 * value), found }),
    ],
  ];
  for (const [reason, spoil] of cases) {
    await assert.rejects(meshed(new Spoilt(spoil)), (error) => {
      assert(error instanceof stellate.OracleError, String(error));
      return error.reason === reason;
    });
  }
});

test("a plain array is called one, alone and among what is found", async () => {
  for (const spoil of [
    ({ points }: stellate.Found) => [...points] as unknown,
    ({ points, found }: stellate.Found) => ({ points: [...points], found }) as unknown,
  ]) {
    const oracle = new Spoilt(spoil as (answer: stellate.Found) => stellate.Found);
    await assert.rejects(meshed(oracle), /returned a plain array of \d+; .* a Float64Array of \d+/);
  }
});

test("a worker of another manifold leaves the mesh alone", async () => {
  const client = new stellate.Client(server);
  const info = await client.create(new stellate.Torus(), { epsilon: 0.1 });
  const other = client.serve(new stellate.ProductOfCircles(), info.name);
  await assert.rejects(other, stellate.InvalidArgument);
  assert.equal(await client.serve(new stellate.Torus(), info.name), "SUCCEEDED");
  client.close();
});

test("a server that is killed and comes back is waited for", async () => {
  const mortal = await RestartingServer.start();
  const said: string[] = [];
  let kills = 0;
  const oracle = new Spoilt((answer) => {
    if (kills++ === 0) mortal.restart();
    return answer;
  });
  const onOutage = (message: string) => said.push(message);
  const mesh = await meshed(oracle, { server: mortal.address, onOutage });
  assert.deepEqual([mesh.vertexCount, mesh.simplexCount], torusCounts);
  assert(mesh.certified);
  assert(said.some((line) => line.startsWith("lost the server")));
  assert(said.some((line) => line.startsWith("the server is back")));
  await mortal.close();
  const gone = meshed(new stellate.Torus(), { server: mortal.address });
  await assert.rejects(gone, stellate.Unavailable);
});

test("TLS and a token", async () => {
  const secrets = fromEnvironment("STELLATE_TEST_SECRETS");
  const at = (name: string) => join(secrets, name);
  const guarded = await RestartingServer.start(
    ...["--tls-cert", at("proxy.pem"), "--tls-key", at("proxy.pem")],
    ...["--token-file", at("tokens")],
  );
  const ca = at("ca.pem");
  const token = (await readFile(at("me.token"), "utf8")).trim();
  const ask = (credentials: stellate.Credentials) =>
    meshed(new stellate.Torus(), {
      server: guarded.address.replace("127.0.0.1", "localhost"),
      credentials,
    });
  const mesh = await ask({ ca, token });
  assert(mesh.certified);
  await assert.rejects(ask({ ca }), stellate.Unauthenticated);
  await assert.rejects(ask({ ca, token: "guessed" }), (error) => {
    assert(error instanceof stellate.Unauthenticated);
    return error.message.includes("give a token");
  });
  await assert.rejects(ask({ tls: true, token }), stellate.Unavailable);
  await guarded.close();
  const plain = () =>
    new stellate.Client("mesh.example.org:7717", { credentials: { token: "secret" } });
  assert.throws(plain, stellate.InvalidArgument);
});
