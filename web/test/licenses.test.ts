import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { afterEach, beforeEach, expect, it } from "vitest";
import { licensesOf, modulesByPackage, noticeOf } from "../licenses.config";

let root = "";
beforeEach(() => (root = mkdtempSync(join(tmpdir(), "licenses."))));
afterEach(() => rmSync(root, { recursive: true }));

/** Makes a package; gives the path of its module. */
function make(name: string, license: string, source: string, text = ""): string {
  const folder = join(root, "node_modules", name);
  mkdirSync(folder, { recursive: true });
  writeFileSync(join(folder, "package.json"), JSON.stringify({ name, version: "1.2.3", license }));
  writeFileSync(join(folder, "index.js"), source);
  if (text) writeFileSync(join(folder, "LICENSE.md"), text);
  return join(folder, "index.js");
}

function licenses(...modules: string[]): string {
  const apache = join(root, "LICENSE");
  writeFileSync(apache, "Apache License");
  return licensesOf(modules, apache);
}

it("finds the packages of a bundle", () => {
  const found = modulesByPackage([
    "/web/src/main.tsx",
    "\0commonjsHelpers.js",
    "/web/node_modules/b/index.js",
    "\0/web/node_modules/@a/c/x/y.js?commonjs-module",
    "/web/node_modules/b/node_modules/d/d.js",
    "/web/node_modules/b/other.js",
  ]);
  expect([...found]).toEqual([
    ["/web/node_modules/@a/c", ["/web/node_modules/@a/c/x/y.js"]],
    ["/web/node_modules/b", ["/web/node_modules/b/index.js", "/web/node_modules/b/other.js"]],
    ["/web/node_modules/b/node_modules/d", ["/web/node_modules/b/node_modules/d/d.js"]],
  ]);
});

it("ships the text of each package's license", () => {
  const text = licenses(
    make("plain", "MIT", "x", "Copyright Ann"),
    make("@some/other", "ISC", "x", "Copyright Bob"),
  );
  for (const part of ["plain 1.2.3, MIT\n\nCopyright Ann", "@some/other 1.2.3, ISC\n\nCopyright Bob"])
    expect(text).toContain(part);
});

it("takes the notices of the sources where a package has no such file", () => {
  const text = licenses(
    make("bare", "Apache-2.0", "// Copyright 2025 Eve\n//\n// Licensed so.\nexport {};\n"),
  );
  expect(text).toContain("bare 1.2.3, Apache-2.0\n\nCopyright 2025 Eve\n\nLicensed so.");
  expect(text.trimEnd().endsWith("Apache License")).toBe(true);
});

it("refuses a package without any text", () => {
  expect(() => licenses(make("bad", "MIT", "// Copyright Mallory\n"))).toThrow(/bad 1.2.3 \(MIT\)/);
  expect(() => licenses(make("silent", "Apache-2.0", "export {};\n"))).toThrow(/silent/);
});

it("reads notices of either form", () => {
  expect(noticeOf("/**\n * @license\n * Copyright Ann\n */\ncode")).toBe("@license\nCopyright Ann");
  expect(noticeOf("// what it does\ncode // Copyright")).toBe("");
});
