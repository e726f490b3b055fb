// Everything but the drawing: the connection, the messages, the mesh, its measures. The page gets
// what it can draw at once, and no more than it asks for.
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import type { Mesh } from "./generated/stellate/v1/mesh_pb";
import {
  ListMeshesRequestSchema,
  ListMeshesResponseSchema,
} from "./generated/stellate/v1/stellate_pb";
import type { Told, ToWorker } from "./messages";
import { report, send, sleep } from "./say";
import { GatewaySource, RecordedSource, type CallEnd, type Source } from "./source";
import { rowOf } from "./verdict";
import { Viewing } from "./viewing";

const kListSeconds = 2;

let source: Source;

async function list() {
  const encode = (request: object) =>
    toBinary(ListMeshesRequestSchema, create(ListMeshesRequestSchema, request));
  for (;;) {
    const meshes: Mesh[] = [];
    let pageToken = "";
    let end: CallEnd;
    do {
      end = await source.call("ListMeshes", encode({ pageSize: 1000, pageToken }), (frame) => {
        const page = fromBinary(ListMeshesResponseSchema, frame);
        meshes.push(...page.meshes);
        pageToken = page.nextPageToken;
      });
    } while (end.code === 0 && pageToken !== "");
    report(end);
    if (end.code === 0) send({ type: "list", meshes: meshes.map(rowOf) });
    await sleep(kListSeconds);
  }
}

let viewing: Viewing | null = null;
let asked = 0; // as of ToWorker

function view(name: string) {
  viewing?.leave();
  send({ type: "workers", rows: [] });
  send({ type: "past", rows: [] });
  send({ type: "verdict", verdict: null });
  viewing = new Viewing(source, name, () => asked);
}

const answers: { [T in Told["type"]]: (m: Extract<Told, { type: T }>) => unknown } = {
  open: async ({ host, secret, lists }) => {
    const gateway = await GatewaySource.open(host, secret);
    gateway.onGreeting = ({ server, mesh, secret: kept }) => {
      gateway.onGreeting = () => {};
      send({ type: "greeting", server, mesh, secret: kept });
    };
    source = gateway;
    if (lists) void list();
  },
  replay: ({ recording }) => {
    source = new RecordedSource(recording);
    send({ type: "greeting", server: "", mesh: "recorded", secret: "" });
  },
  watch: ({ name }) => view(name),
  revision: ({ revision }) => viewing?.show(revision),
  look: ({ name, look }) => {
    if (viewing?.name === name) viewing.lookAt(look);
  },
  faults: ({ fault }) => viewing?.choose(fault),
  pick: ({ ray, pin }) => viewing?.pick(ray, pin),
  find: ({ ids }) => viewing?.find(ids),
  save: ({ format }) => viewing?.save(format),
  measure: () => viewing?.measure(),
  drawn: () => viewing?.drawn(),
};

self.onmessage = ({ data }: MessageEvent<ToWorker>) => {
  asked = data.asked ?? asked;
  void (answers[data.type] as (message: Told) => unknown)(data);
};
