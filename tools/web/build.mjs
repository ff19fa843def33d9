// Builds the bundles in msahl/post/web from the packages of package-lock.json, with their licences
// and vendor.json. `node build.mjs --check` writes nothing and compares: exit status 1 if a file differs.
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const HERE = dirname(fileURLToPath(import.meta.url));
const TARGET = join(HERE, "../../msahl/post/web");
const BUNDLES = [
  { name: "three", global: "THREE", source: "https://github.com/mrdoob/three.js" },
  { name: "uplot", global: "uPlot", source: "https://github.com/leeoniya/uPlot", styles: "dist/uPlot.min.css" },
];
// The page inserts a bundle as a classic script: it defines one global and imports nothing.
const OPTIONS = { bundle: true, minify: true, format: "iife", target: "es2022", legalComments: "none" };

const packaged = (name, file) => readFileSync(join(HERE, "node_modules", name, file), "utf8");
const sha256 = (text) => createHash("sha256").update(text).digest("hex");

async function bundled({ name, global, source, styles }) {
  const { version, license } = JSON.parse(packaged(name, "package.json"));
  const options = { ...OPTIONS, globalName: global };
  // The default export of uPlot is the library itself.
  if (name === "uplot") options.footer = { js: "uPlot=uPlot.default;" };
  const result = await build({ ...options, entryPoints: [join(HERE, `${name}.js`)], write: false });
  const files = {
    [`${name}.min.js`]: result.outputFiles[0].text,
    [`${name}.LICENSE`]: packaged(name, "LICENSE"),
  };
  if (styles) files[`${name}.min.css`] = packaged(name, styles);
  const line =
    `esbuild ${name}.js --bundle --minify --format=iife --global-name=${global} ` +
    `--target=es2022 --legal-comments=none` + (options.footer ? ` --footer:js='${options.footer.js}'` : "");
  const digests = Object.fromEntries(Object.entries(files).map(([file, text]) => [file, sha256(text)]));
  const esbuild = JSON.parse(packaged("esbuild", "package.json")).version;
  return { files, record: { version, licence: license, source, esbuild, build: line, sha256: digests } };
}

const files = {};
const records = {};
for (const bundle of BUNDLES) {
  const made = await bundled(bundle);
  Object.assign(files, made.files);
  records[bundle.name] = made.record;
}
files["vendor.json"] = JSON.stringify(records, null, 2) + "\n";

const checking = process.argv.includes("--check");
let different = 0;
for (const [name, text] of Object.entries(files)) {
  const path = join(TARGET, name);
  if (!checking) {
    writeFileSync(path, text);
    continue;
  }
  let stored = null;
  try {
    stored = readFileSync(path, "utf8");
  } catch {
    // A missing file differs.
  }
  const same = stored === text;
  different += !same;
  console.log(`${same ? "equal    " : "DIFFERENT"} ${name}`);
}
process.exitCode = different ? 1 : 0;
