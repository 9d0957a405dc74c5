#!/usr/bin/env node
// Opens pages of `lightkiln study` in headless Chromium, as a person would who has no network.
//
// usage: check_pages.mjs [--screenshots FOLDER] PAGE.html...
//
// A page passes when every plot that it promises is drawn with the traces it has, every table has rows and every picture
// pixels, a legend's entry answers to a click, nothing is asked of the network, and no error is told to the console.
// Prints "... N passed, N failed"; exit code 1 when a page failed, 2 on wrong usage or where there is no browser.
// Chromium is found by its usual names or by the variable CHROMIUM. Set up once with "npm ci" in this folder.

import { access, mkdir, mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const usage = "usage: check_pages.mjs [--screenshots FOLDER] PAGE.html...";
const WIDTH = 1280;
const HEIGHT = 900;
// No word to anybody: no updates, no safe-browsing lists, no experiments.
const QUIET = ["--no-first-run", "--disable-quic", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-gpu"];

async function browserPath() {
  const names = ["chromium", "chromium-browser", "google-chrome"].map((name) => `/usr/bin/${name}`);
  for (const path of [process.env.CHROMIUM, ...names].filter(Boolean)) {
    if (await access(path).then(() => true, () => false)) return path;
  }
  throw new Error("no Chromium is installed; on Debian: apt-get install chromium");
}

/** What a page shows: counted in the page itself. */
function inventory() {
  const all = (selector, of = document) => [...of.querySelectorAll(selector)];
  const plots = all(".plot").map((plot) => {
    const drawn = plot.querySelector(".js-plotly-plot");
    const promised = drawn?.data ?? [];
    const marks = (trace) => (trace.type === "bar" ? trace.y.length : trace.x.length);
    return {
      title: drawn?.layout?.title?.text ?? "",
      svgs: all("svg.main-svg", plot).length,
      traces: promised.length,
      drawn: all(".scatterlayer .trace, .barlayer .trace", plot).length,
      points: promised.reduce((sum, trace) => sum + marks(trace), 0),
      width: drawn?.getBoundingClientRect().width ?? 0,
    };
  });
  const tables = all("table").map((table) => ({ rows: all("tbody tr", table).length, columns: all("thead th", table).length }));
  const pictures = all("img").map((picture) => picture.naturalWidth);
  return { heading: document.querySelector("h1")?.textContent ?? "", plots, tables, pictures };
}

async function faultsOf(page, file) {
  const faults = [];
  page.on("console", (message) => message.type() === "error" && faults.push(`console: ${message.text()}`));
  page.on("pageerror", (error) => faults.push(`script: ${error.message}`));
  page.on("request", (request) => /^(file|data|blob):/.test(request.url()) || faults.push(`asks the network for ${request.url()}`));
  await page.goto(pathToFileURL(resolve(file)).href, { waitUntil: "load" });
  const promised = await page.locator(".plot").count();
  if (promised > 0) {
    await page.waitForFunction((count) => document.querySelectorAll(".js-plotly-plot svg.main-svg").length >= count, promised, { timeout: 60_000 });
  }
  const { heading, plots, tables, pictures } = await page.evaluate(inventory);
  const expect = (good, what) => good || faults.push(what);
  expect(heading !== "", "no heading");
  expect(tables.length > 0, "no table");
  tables.forEach((table, i) => expect(table.rows > 0 && table.columns > 0, `table ${i + 1} is empty`));
  pictures.forEach((width, i) => expect(width > 0, `picture ${i + 1} has no pixels`));
  for (const plot of plots) {
    expect(plot.svgs > 0 && plot.width > WIDTH / 4, `"${plot.title}" is not drawn`);
    expect(plot.traces > 0 && plot.points > 0, `"${plot.title}" has no data`);
    expect(plot.drawn === plot.traces, `"${plot.title}" shows ${plot.drawn} of ${plot.traces} traces`);
  }
  const hidden = await clickLegend(page);
  expect(hidden !== false, "a click on a legend's entry hides nothing");
  const points = plots.reduce((sum, plot) => sum + plot.points, 0);
  const rows = tables.reduce((sum, table) => sum + table.rows, 0);
  return { faults, summary: `${plots.length} plots with ${points} points, ${rows} rows, ${pictures.length} pictures` };
}

/** Whether the plots are alive: an entry of a legend hides its trace, and shows it again. Nothing where there is no legend. */
async function clickLegend(page) {
  const entry = page.locator(".legendtoggle").first();
  if ((await entry.count()) === 0) return null;
  const off = () => page.evaluate(() => document.querySelector(".js-plotly-plot:has(.legendtoggle)").data.filter((trace) => trace.visible === "legendonly").length);
  const press = async () => {
    await entry.click();
    await page.waitForTimeout(700); // the library waits for a second click
    return off();
  };
  return (await press()) === 1 && (await press()) === 0;
}

async function main() {
  const words = process.argv.slice(2);
  const at = words.indexOf("--screenshots");
  const [, folder] = at >= 0 ? words.splice(at, 2) : [];
  if (words.length === 0 || (at >= 0 && !folder)) {
    console.error(usage);
    return 2;
  }
  if (folder) await mkdir(folder, { recursive: true });
  const home = await mkdtemp(join(tmpdir(), "pages-"));
  const root = process.getuid?.() === 0;
  const browser = await chromium.launchPersistentContext(home, {
    executablePath: await browserPath(),
    headless: true,
    args: root ? [...QUIET, "--no-sandbox"] : QUIET,
    viewport: { width: WIDTH, height: HEIGHT },
  });
  let failed = 0;
  for (const file of words) {
    const page = await browser.newPage();
    const { faults, summary } = await faultsOf(page, file).catch((error) => ({ faults: [error.message], summary: "" }));
    if (folder) await page.screenshot({ path: join(folder, `${basename(file, ".html")}.png`), fullPage: true });
    await page.close();
    faults.forEach((fault) => console.log(`FAIL  ${file}: ${fault}`));
    if (faults.length === 0) console.log(`ok    ${file}: ${summary}`);
    failed += faults.length > 0;
  }
  await browser.close();
  await rm(home, { recursive: true, force: true });
  console.log(`pages: ${words.length - failed} passed, ${failed} failed`);
  return failed > 0 ? 1 : 0;
}

main().then(
  (code) => process.exit(code),
  (error) => {
    console.error(error.message);
    process.exit(2);
  },
);
