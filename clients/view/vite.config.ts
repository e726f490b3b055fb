import { existsSync, readFileSync } from "node:fs";
import { defineConfig, type Plugin } from "vite";
import { viteSingleFile } from "vite-plugin-singlefile";

// What others wrote and the page holds goes with their names and licences.
function notices(packages: string[]): Plugin {
  return {
    name: "notices",
    transformIndexHtml(page) {
      const texts = packages.map((name) => {
        const folder = `node_modules/${name}`;
        const { version, license } = JSON.parse(readFileSync(`${folder}/package.json`, "utf8"));
        const file = `${folder}/LICENSE`;
        const text = existsSync(file) ? readFileSync(file, "utf8") : "";
        return `${name} ${version}, ${license}\n\n${text}`.replaceAll("--", "- -");
      });
      return `${page}\n<!--\nThis page holds\n\n${texts.join("\n")}\n-->\n`;
    },
  };
}

// One file: the page is a part of the command line, and a report to send around.
export default defineConfig({
  plugins: [notices(["three", "uplot", "@bufbuild/protobuf"]), viteSingleFile()],
  build: { target: "es2022", chunkSizeWarningLimit: 2000 },
  worker: { format: "iife" },
});
