// A glTF as three.js shows it in a browser: no lamps, no tone curve, through the file's first camera.
//
// usage: node three_view.mjs FILE.glb OUT.rgb WIDTH HEIGHT EV
//        OUT.rgb: three bytes a pixel, row by row from the top
//
// Needs Chromium (CHROMIUM, or /usr/bin/chromium) and `npm install --no-save three playwright-core` in tools. Exit code 0: shown.
import { createServer } from "node:http";
import { createReadStream, existsSync, writeFileSync } from "node:fs";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const [file, out, width, height, ev] = process.argv.slice(2);
const modules = join(dirname(fileURLToPath(import.meta.url)), "node_modules");
const PAGE = `<!doctype html>
<script type="importmap">
  {"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}
</script>
<script type="module">
  import * as THREE from "three";
  import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
  try {
    const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    renderer.setSize(${Number(width)}, ${Number(height)});
    renderer.toneMapping = THREE.LinearToneMapping;
    renderer.toneMappingExposure = 2 ** ${Number(ev)};
    const { scene, cameras } = await new GLTFLoader().loadAsync("/scene.glb");
    cameras[0].aspect = ${Number(width)} / ${Number(height)};
    cameras[0].updateProjectionMatrix();
    scene.updateMatrixWorld(true);
    renderer.setClearColor(0);
    renderer.render(scene, cameras[0]);
    const gl = renderer.getContext();
    const rgba = new Uint8Array(${4 * Number(width) * Number(height)});
    gl.readPixels(0, 0, ${Number(width)}, ${Number(height)}, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
    window.shown = Array.from(rgba);
  } catch (error) {
    window.shown = String(error);
  }
</script>`;

const server = createServer((asked, answer) => {
  if (asked.url === "/") return answer.setHeader("content-type", "text/html").end(PAGE);
  const path = asked.url === "/scene.glb" ? file : join(modules, normalize(asked.url));
  if (!existsSync(path)) return answer.writeHead(404).end();
  answer.setHeader("content-type", extname(path) === ".js" ? "text/javascript" : "application/octet-stream");
  createReadStream(path).pipe(answer);
}).listen(0, "127.0.0.1");
await new Promise((ready) => server.once("listening", ready));
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  // The last ones keep it from asking the network for anything.
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"],
});
try {
  const page = await browser.newPage();
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  await page.waitForFunction("window.shown", null, { timeout: 300_000 });
  const rgba = await page.evaluate("window.shown");
  if (typeof rgba === "string") throw new Error(rgba);
  const rgb = Buffer.alloc(3 * width * height);
  for (let y = 0; y < Number(height); y++) {
    for (let x = 0; x < Number(width); x++) {
      // WebGL counts rows from below.
      const from = 4 * ((height - 1 - y) * width + x);
      for (let c = 0; c < 3; c++) rgb[3 * (y * width + x) + c] = rgba[from + c];
    }
  }
  writeFileSync(out, rgb);
} finally {
  await browser.close();
  server.close();
}
