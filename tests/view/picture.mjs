// Takes the picture of docs/using/viewer.md again, with the environment of viewer_test (CMakeLists.txt):
//
//   node tests/view/picture.mjs docs/viewer.png
import { resize, Stage, still, until } from "./stage.mjs";

const stage = new Stage();
try {
  await stage.open();
  await stage.mesh({ shape: "flat torus", epsilon: 0.6, label: "three circles" });
  await stage.mesh({ shape: "two spheres", epsilon: 0.15, label: "two spheres" });
  const torus = await stage.mesh({ shape: "torus", epsilon: 0.08, label: "a torus" });
  const page = await stage.look(torus);
  await resize(page, 1280, 800);
  await until(page, () => document.querySelectorAll("#histograms canvas").length === 4);
  await until(page, () => document.querySelectorAll("#list button").length === 3);
  await still(page);
  // The address as a reader has it, not that of this picture's own server.
  await page.evaluate(() => (document.getElementById("server").textContent = "127.0.0.1:7717"));
  await page.screenshot({ path: process.argv[2] });
} finally {
  await stage.close();
}
