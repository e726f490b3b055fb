import assert from "node:assert/strict";
import {
  appendFile,
  chmod,
  mkdir,
  mkdtemp,
  readFile,
  rename,
  rm,
  symlink,
  writeFile,
} from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import * as stellate from "../src/index.js";
import { torusCounts } from "./live.js";

let folder = "";
before(async () => {
  folder = await mkdtemp(join(tmpdir(), "stellate-test-"));
});
after(() => rm(folder, { recursive: true }));

/** The torus, and how often it was asked. */
class Counting extends stellate.Torus {
  asked = 0;

  override closestPoint(x: Float64Array, n: number): stellate.Found {
    this.asked += n;
    return super.closestPoint(x, n);
  }
}

test("an aborted mesh goes on where it was, and a finished one is there at once", async () => {
  const checkpoint = join(folder, "aborted");
  const aborting = new AbortController();
  const first = new Counting();
  const onProgress = (progress: stellate.Progress) => {
    if (progress.vertices > 500) aborting.abort();
  };
  const { signal } = aborting;
  await assert.rejects(
    stellate.mesh(first, { epsilon: 0.05, checkpoint, signal, onProgress }),
    (error) => {
      assert(error instanceof stellate.Cancelled, String(error));
      assert.match(error.message, /the same call goes on from there/);
      return (error.mesh?.vertexCount ?? 0) > 0;
    },
  );
  const second = new Counting();
  const label = "another label is no other mesh";
  const mesh = await stellate.mesh(second, { epsilon: 0.05, checkpoint, label });
  const straight = await stellate.mesh(new stellate.Torus(), { epsilon: 0.05 });
  assert.deepEqual(mesh.points, straight.points);
  assert.deepEqual(mesh.simplices, straight.simplices);
  assert(first.asked > 0 && second.asked < (straight.report?.counts?.queries ?? 0));
  const [line = "", ...rest] = (await readFile(join(checkpoint, "mesh"), "latin1")).split("\n");
  assert.match(line, /^meshes\/\S+$/);
  assert.equal(rest.join("\n")[0], "\b"); // a MeshSpec's first field, as all languages write it
  await appendFile(join(checkpoint, "mesh"), "R\0"); // an empty label, which others leave out
  const third = new Counting();
  const again = await stellate.mesh(third, { epsilon: 0.05, checkpoint });
  assert.equal(third.asked, 0);
  assert(again.certified && again.vertexCount === mesh.vertexCount);
  await assert.rejects(stellate.mesh(third, { epsilon: 0.06, checkpoint }), (error) => {
    return error instanceof stellate.InvalidArgument && /another specification/.test(error.message);
  });
});

test("a mesh whose oracle threw waits for a better one", async () => {
  const checkpoint = join(folder, "threw");
  class Raising extends Counting {
    override closestPoint(x: Float64Array, n: number): stellate.Found {
      const answer = super.closestPoint(x, n);
      if (this.asked > 300) throw new Error("no such surface");
      return answer;
    }
  }
  await assert.rejects(
    stellate.mesh(new Raising(), { epsilon: 0.1, checkpoint }),
    /no such surface/,
  );
  const mesh = await stellate.mesh(new stellate.Torus(), { epsilon: 0.1, checkpoint });
  assert.deepEqual([mesh.vertexCount, mesh.simplexCount], torusCounts);
  await assert.rejects(
    stellate.mesh(new Counting(), { epsilon: 0.1, checkpoint, server: "localhost:1" }),
    stellate.InvalidArgument,
  );
});

test("a folder in which others could have put something is refused", async () => {
  const refused = async (checkpoint: string, words: RegExp) => {
    await assert.rejects(
      stellate.mesh(new stellate.Torus(), { epsilon: 0.3, checkpoint }),
      (error) => {
        return error instanceof stellate.InvalidArgument && words.test(error.message);
      },
    );
  };
  const open = join(folder, "open");
  await mkdir(open);
  await chmod(open, 0o777);
  await refused(open, /mode 777.*chmod go-w/);
  await symlink(folder, join(folder, "link"));
  await refused(join(folder, "link"), /is a link/);
  await refused(join(folder, "link/"), /is a link/);

  const precious = join(folder, "precious");
  const checkpoint = join(folder, "planted");
  await writeFile(precious, "mine");
  await mkdir(checkpoint, { mode: 0o700 });
  await symlink(precious, join(checkpoint, "mesh.new"));
  await stellate.mesh(new stellate.Torus(), { epsilon: 0.3, checkpoint });
  assert.equal(await readFile(precious, "utf8"), "mine");
  await rename(join(checkpoint, "mesh"), precious);
  await symlink(precious, join(checkpoint, "mesh"));
  await refused(checkpoint, /mesh is a link/);
});
