import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";

import { PATIENCE_MS, run, Server } from "./server.mjs";

const TOKEN = "a-token-of-this-test";
const limit = { timeout: PATIENCE_MS };
const open = new Server();
const secured = new Server();
before(async () => {
  await open.start();
  await secured.startSecured(TOKEN, "viewer");
}, limit);
after(async () => {
  await open.stop();
  await secured.stop();
});

/** Those of the README, as it has them. */
function commands() {
  const text = readFileSync(new URL("../../README.md", import.meta.url), "utf8").replaceAll("\\\n", " ");
  return text.split("\n").filter((line) => line.startsWith("    ") && line.includes("buf curl"));
}

async function assertAnswers(command) {
  const server = command.includes("https://") ? secured : open;
  const env = { TACLINK_SERVER: server.address, TACLINK_TLS_CA: server.path("ca.pem"), TACLINK_TOKEN: TOKEN };
  // The dashboard's port is the only address that is written out.
  const runnable = command.replace("http://127.0.0.1:8080", open.page);
  const { status, stdout, stderr } = await run("sh", ["-c", runnable], env);
  assert.equal(status, 0, `${runnable}\n${stderr}`);
  if (command.includes("GetArm")) {
    assert.equal(JSON.parse(stdout).arm.name, "test");
  } else {
    assert.ok(stdout.includes('"link": "sleeve"'), stdout);
    assert.ok(stdout.match(/"utcNs"/g).length > 1, stdout); // each message has one
  }
}

test("what the README says of buf curl works word by word", limit, async () => {
  const all = commands();
  assert.equal(all.length, 5);
  for (const command of all) await assertAnswers(command);
});

test("buf has nothing against the API's files", limit, async () => {
  const { status, stdout } = await run("npx", ["buf", "lint", "../../proto"]);
  assert.equal(stdout, "");
  assert.equal(status, 0);
});
