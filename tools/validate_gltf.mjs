#!/usr/bin/env node
// Runs the Khronos glTF validator.
//
// usage: validate_gltf.mjs FILE...                           exit 1 when any file has an error
//        validate_gltf.mjs --baseline INPUT OUTPUT ...       exit 1 when an OUTPUT has an error that its INPUT did not have
//
// Exit code 2: wrong usage, or a file that could not be read. Set up once with "npm ci" in this folder.

import { readFile } from "node:fs/promises";
import { dirname, resolve } from "node:path";
import validator from "gltf-validator";

const ERROR = 0; // the validator's severities run 0 error, 1 warning, 2 information, 3 hint
const usage = "usage: validate_gltf.mjs FILE... | validate_gltf.mjs --baseline INPUT OUTPUT [INPUT OUTPUT ...]";

async function issuesOf(path) {
  const bytes = new Uint8Array(await readFile(path));
  const report = await validator.validateBytes(bytes, {
    uri: path,
    maxIssues: 0,
    writeTimestamp: false,
    externalResourceFunction: async (uri) => new Uint8Array(await readFile(resolve(dirname(path), decodeURIComponent(uri)))),
  });
  return report.issues;
}

const errorsIn = (issues) => issues.messages.filter((issue) => issue.severity === ERROR);

// A mesh that is written again for another instance repeats the input's error at a new index, so indices do not count.
const kind = (issue) => `${issue.code} ${(issue.pointer ?? "").replace(/\d+/g, "#")}`;

function printErrors(path, errors, issues, verdict) {
  console.log(`${verdict}  ${path}  (${issues.numErrors} errors, ${issues.numWarnings} warnings)`);
  if (errors.length === 0) return;
  const rows = errors.map((issue) => [issue.code, issue.pointer ?? `byte ${issue.offset}`, issue.message]);
  const width = [0, 1].map((column) => Math.max(...rows.map((row) => row[column].length)));
  for (const [code, where, message] of rows) {
    console.log(`      ${code.padEnd(width[0])}  ${where.padEnd(width[1])}  ${message}`);
  }
}

async function validate(path) {
  const issues = await issuesOf(path);
  const errors = errorsIn(issues);
  printErrors(path, errors, issues, errors.length ? "FAIL" : "ok  ");
  return errors.length === 0;
}

async function validateAgainst(input, output) {
  const known = new Set(errorsIn(await issuesOf(input)).map(kind));
  const issues = await issuesOf(output);
  const fresh = errorsIn(issues).filter((issue) => !known.has(kind(issue)));
  printErrors(output, fresh, issues, fresh.length ? "FAIL" : "ok  ");
  if (known.size) console.log(`      ${known.size} kinds of error were in ${input} already`);
  return fresh.length === 0;
}

const paths = process.argv.slice(2);
const compare = paths[0] === "--baseline";
if (compare) paths.shift();
if (paths.length === 0 || paths.some((path) => path.startsWith("-")) || (compare && paths.length % 2)) {
  console.error(usage);
  process.exit(2);
}

let failed = 0;
const step = compare ? 2 : 1;
for (let at = 0; at < paths.length; at += step) {
  try {
    const good = compare ? await validateAgainst(paths[at], paths[at + 1]) : await validate(paths[at]);
    if (!good) failed += 1;
  } catch (problem) {
    console.error(`cannot validate ${paths[at + step - 1]}: ${problem.message ?? problem}`);
    process.exit(2);
  }
}
const checked = paths.length / step;
console.log(`validator: ${checked - failed} passed, ${failed} failed`);
process.exit(failed ? 1 : 0);
