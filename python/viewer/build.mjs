// Writes three.js, tree-shaken, and its licence to the package: `npm ci && npm run build`.
import { build } from "esbuild";
import { copyFile, readFile } from "node:fs/promises";

const assets = new URL("../hydrograd/_viewer/assets/", import.meta.url);
const library = new URL("node_modules/three/", import.meta.url);
const { version } = JSON.parse(await readFile(new URL("package.json", library)));
const bundle = new URL("three.bundle.js", assets).pathname;

await build({
  entryPoints: [new URL("three.js", import.meta.url).pathname],
  outfile: bundle,
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "THREE",
  target: "es2020",
  charset: "ascii",
  banner: { js: `/* three.js ${version}, (c) three.js authors, MIT licence: see three.LICENSE */` },
});
const text = await readFile(bundle, "utf8");
if (/<\/script|<!--/i.test(text)) throw new Error("the bundle would end the page's script element");
await copyFile(new URL("LICENSE", library), new URL("three.LICENSE", assets));
