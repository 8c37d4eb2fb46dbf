import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";

// Packages without a file of their own have this license, whose text is also this project's.
const APACHE = "Apache-2.0";
const RULE = "\n" + "-".repeat(80) + "\n\n";

/** The packages that modules of a bundle come from, by their folders; paths as the bundler names them. */
export function modulesByPackage(modules: Iterable<string>): Map<string, string[]> {
  const found = new Map<string, string[]>();
  for (const module of modules) {
    const match = /^\0?((.*\/node_modules\/(?:@[^/]+\/)?[^/?]+)\/[^?]+)/.exec(module);
    if (match) found.set(match[2]!, [...(found.get(match[2]!) ?? []), match[1]!]);
  }
  return new Map([...found].sort(([a], [b]) => (a < b ? -1 : 1)));
}

/** What a source says at its top about copyright and license. */
export function noticeOf(source: string): string {
  const head = /^(?:#!.*\n)?\s*((?:\/\/.*\n?)+|\/\*[^]*?\*\/)/.exec(source)?.[1] ?? "";
  if (!/copyright|licen[cs]e/i.test(head)) return "";
  return head
    .replace(/^\/\*+!?|\*\/$/g, "")
    .replace(/^[ \t]*(?:\/\/|\*)[ \t]?/gm, "")
    .trim();
}

/** Name, version, license and its text of one package. Throws where the package has no text. */
function entryOf(folder: string, modules: string[]): string {
  const { name, version, license } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  const read = (path: string) => readFileSync(path, "utf8").trim();
  const files = readdirSync(folder)
    .filter((file) => /^(licen[cs]e|notice|copying)/i.test(file))
    .sort();
  let texts = files.map((file) => read(join(folder, file)));
  if (texts.length === 0) {
    texts = [...new Set(modules.map((module) => noticeOf(read(module))))].filter((text) => text);
    if (texts.length === 0 || !String(license).includes(APACHE))
      throw new Error(
        `${name} ${version} (${license}) has no text of its license to ship with the dashboard`,
      );
    texts.push(`The text of ${APACHE} is at the end.`);
  }
  return `${name} ${version}, ${license}\n\n${texts.join("\n\n")}\n`;
}

/** The licenses of all packages that a bundle is made of, as text. `apache`: the file with that license. */
export function licensesOf(modules: Iterable<string>, apache: string): string {
  const entries = [...modulesByPackage(modules)].map(([folder, own]) => entryOf(folder, own));
  const head = "The dashboard contains these packages:\n";
  return [head, ...entries, `${APACHE}\n\n${readFileSync(apache, "utf8").trim()}\n`].join(RULE);
}
