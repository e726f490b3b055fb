// Takes the pictures of docs/using/viewer.md again, with the environment of viewer_test (CMakeLists.txt):
//
//   node tests/view/picture.mjs docs
import { finished, resize, Stage, still, until } from "./stage.mjs";
import { choose } from "./walk.mjs";

const stage = new Stage();

// With the address as a reader has it, not that of these pictures' own server.
async function take(page, name) {
  await still(page);
  await page.evaluate(() => (document.getElementById("server").textContent = "127.0.0.1:7717"));
  await page.screenshot({ path: `${process.argv[2]}/${name}.png` });
}

try {
  await stage.open();
  await stage.mesh({ shape: "flat torus", epsilon: 0.6, label: "three circles" });
  await stage.mesh({ shape: "grain", epsilon: 0.4, label: "two materials" });
  await stage.mesh({ shape: "grain", epsilon: 0.2, label: "two materials, finer" });
  const torus = await stage.mesh({ shape: "torus", epsilon: 0.08, label: "a torus" });
  const page = await stage.look(torus);
  await resize(page, 1280, 800);
  await finished(page);
  await until(page, () => document.querySelectorAll("#histograms canvas").length === 4);
  await until(page, () => document.querySelectorAll("#list button").length === 4);
  const { x, y, width, height } = await page.locator("#canvas").boundingBox();
  await page.locator("#colour").selectOption("2");
  await still(page);
  await page.mouse.move(x + 0.3 * width, y + 0.53 * height);
  await until(page, () => !document.getElementById("hint").hidden);
  await take(page, "viewer");

  await page.mouse.move(0, 0);
  await choose(page, "two materials, finer");
  await finished(page);
  await page.locator("#beside").selectOption({ label: "two materials" });
  await until(page, () => /simplices/.test(document.getElementById("beside-facts").textContent));
  await take(page, "viewer-beside");
} finally {
  await stage.close();
}
