import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { connect } from "../lib/taclink.mjs";
import { assertFails, PATIENCE_MS, run, Server, TOUCH, until } from "./server.mjs";

const limit = { timeout: PATIENCE_MS };
const server = new Server();
let taclink;
before(async () => {
  await server.start();
  taclink = await connect({ server: server.address });
}, limit);
after(async () => {
  taclink?.close();
  await server.stop();
});

function example(name, ...options) {
  return run(process.execPath, [name, ...options], { TACLINK_SERVER: server.address });
}

test("contacts.mjs prints links, forces in N and places in m", limit, async () => {
  const row = await until("a touch", async () => {
    const { status, stdout, stderr } = await example("contacts.mjs", "--count", "2");
    assert.equal(status, 0, stderr);
    assert.match(stdout, /^arm test, server \d.*\n {2}sleeve: [a-z]+, /);
    assert.equal(stdout.match(/ contacts, total (\(.*\) N|not known)$/gm).length, 2, stdout);
    const found = /^ {2}sleeve #\d+: (\S+) N, force \(.*\) N at \(.*\) m$/m.exec(stdout);
    return found && Number(found[1]) > 0.9 * TOUCH.force_n && found;
  });
  assert.ok(Number(row[1]) < 1.1 * TOUCH.force_n, row[0]);
});

test("record_replay.mjs records, lists, plays and deletes", limit, async () => {
  const options = ["--seconds", "1", "--speed", "0", "--name", "short", "--delete"];
  const { status, stdout, stderr } = await example("record_replay.mjs", ...options);
  assert.equal(status, 0, stderr);
  const [, log, recorded] = /^recorded (short-\S+\.mcap): (\d+) frames, 0 lost/m.exec(stdout);
  assert.ok(stdout.includes(`  ${log}: `), stdout);
  const [, played] = /^played (\d+) frames in .* 0 places damaged$/m.exec(stdout);
  assert.equal(played, recorded);
  assert.deepEqual((await taclink.recording.listLogs()).logs, []);
});

test("a signal ends the recording early", limit, async () => {
  const options = ["record_replay.mjs", "--seconds", "3600", "--speed", "0", "--delete"];
  for (const signal of ["SIGINT", "SIGTERM"]) {
    const end = (output, child) => /^records for .*\n$/.test(output) && child.kill(signal);
    const { status, stdout, stderr } = await run(
      process.execPath,
      options,
      { TACLINK_SERVER: server.address },
      end,
    );
    assert.equal(status, 0, stderr);
    assert.match(stdout, /^recorded example-/m);
  }
});

test("a recording that is under way is not disturbed", limit, async () => {
  await taclink.recording.startRecording({ name: "first" });
  await assertFails(example("record_replay.mjs"), /^error: first-\S+ is being recorded.*FAILED_PRECONDITION/);
  assert.equal((await taclink.recording.stopRecording()).status.state, "RECORDER_STATE_IDLE");
});

test("a server that ends is told", limit, async () => {
  const mortal = await new Server().start();
  try {
    const stop = (output) => output.includes(" total ") && mortal.process.kill("SIGTERM");
    const options = ["contacts.mjs", "--server", mortal.address];
    const { status, stderr } = await run(process.execPath, options, {}, stop);
    assert.equal(status, 1);
    assert.match(stderr, /^error: .*UNAVAILABLE\)\n$/);
  } finally {
    await mortal.stop();
  }
});

test("failures are one line and status 1", limit, async () => {
  const nobody = `unix:${server.path("no-such-socket")}`;
  for (const name of ["contacts.mjs", "record_replay.mjs"]) {
    await assertFails(example(name, "--server", nobody), /^error: no server answers at unix:.*ENOENT/);
  }
  await assertFails(example("contacts.mjs", "--rate", "often"), /^error: --rate must be a number/);
  await assertFails(example("contacts.mjs", "--colour"), /^error: .*--colour/);
});
