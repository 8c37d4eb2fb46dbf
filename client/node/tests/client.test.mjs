import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";

import { connect, secondsBetween, utcText } from "../lib/taclink.mjs";
import { PATIENCE_MS, Server, STANDING_ARM, TOUCH } from "./server.mjs";

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

test("the arm is told in full, with names of enums and exact whole numbers", limit, async () => {
  const { arm } = await taclink.tactile.getArm();
  assert.equal(arm.name, "test");
  const [link] = arm.links;
  assert.equal(link.name, TOUCH.link);
  assert.equal(link.source.kind, "SOURCE_KIND_SIMULATED");
  assert.equal(link.model.markers.rest_positions_m.length, 3 * 24 * 10);
  assert.equal(typeof link.statistics.frames, "string");
  assert.deepEqual(link.base_from_link.translation_m, { x: 0, y: 0, z: 0.1 });
});

async function touched() {
  for await (const message of taclink.tactile.streamContacts({}, { silenceS: PATIENCE_MS / 1000 })) {
    if (message.contacts.some((contact) => contact.normal_force_n > 0.9 * TOUCH.force_n)) return message;
  }
}

test("a touch comes with its force and its place in the base frame", limit, async () => {
  const [contact] = (await touched()).contacts;
  assert.equal(contact.link, TOUCH.link);
  assert.ok(Math.abs(contact.normal_force_n - TOUCH.force_n) < 0.02, `${contact.normal_force_n} N`);
  const { x, y, z } = contact.center_m;
  assert.ok(Math.abs(Math.atan2(y, x) - TOUCH.angle_rad) < 0.1, `at (${x}, ${y}) m`);
  assert.ok(Math.abs(z - TOUCH.z_m) < 0.005, `z ${z} m`);
  // A time in ns is more than a double holds; as text nothing of it is lost.
  assert.equal(BigInt(contact.exposure_utc_ns).toString(), contact.exposure_utc_ns);
});

test("a loop that is left ends its call on the server", limit, async () => {
  // Many more than the server allows at a time.
  for (let i = 0; i < 100; ++i) {
    for await (const { message } of taclink.tactile.streamFrames()) {
      assert.equal(message, "status");
      break;
    }
  }
});

test("silence ends a stream", limit, async () => {
  const listen = async () => {
    for await (const _ of taclink.tactile.streamContacts({}, { silenceS: 0.5 }))
      server.process.kill("SIGSTOP");
  };
  try {
    await assert.rejects(listen(), /nothing from the server for 0.5 s/);
    await assert.rejects(listen(), /nothing from the server for 0.5 s/);
  } finally {
    server.process.kill("SIGCONT");
  }
});

test("what the server refuses is an error with its words and code", limit, async () => {
  await assert.rejects(taclink.operations.restartLink({ link: "elbow" }), { code: 5, details: /elbow/ });
  const frames = taclink.tactile.streamFrames({ links: ["elbow"] });
  await assert.rejects(frames.next(), { code: 5, details: /elbow/ });
  const states = [{ names: ["shoulder"], positions: [0] }];
  await assert.rejects(taclink.tactile.updateJointStates(states), { code: 9, details: /URDF/ });
});

test("joint states are taken as they come", limit, async () => {
  const urdf = fileURLToPath(new URL("../../../deploy/config/arm.urdf", import.meta.url));
  const arm = STANDING_ARM.replace("arm:\n", `arm:\n  urdf: ${urdf}\n`).replace(
    "{position",
    "{frame: forearm, position",
  );
  const jointed = new Server();
  let other;
  try {
    await jointed.start({ arm });
    other = await connect({ server: jointed.address });
    const { joints } = (await other.tactile.getArm()).arm;
    const names = joints.map((joint) => joint.name);
    const COUNT = 200;
    async function* states() {
      const startNs = BigInt(Date.now()) * 1_000_000n - 300_000_000n;
      for (let i = 0; i < COUNT; ++i) {
        const utcNs = (startNs + BigInt(i) * 1_000_000n).toString();
        yield { names, positions: names.map(() => 0.001 * i), utc_ns: utcNs };
      }
    }
    const done = await other.tactile.updateJointStates(states());
    assert.deepEqual(done, { accepted: String(COUNT), refused: "0", first_refusal: "" });
    const wrong = (async function* () {
      for (;;) yield { names: ["no such joint"], positions: [0], utc_ns: "1" };
    })();
    await assert.rejects(other.tactile.updateJointStates(wrong), { code: 3, details: /no such joint/ });
  } finally {
    other?.close();
    await jointed.stop();
  }
});

test("times are exact", () => {
  assert.equal(secondsBetween("1795402699321190209", "1795402699321190309"), 100 / 1e9);
  assert.equal(utcText("1795402699321190209"), "2026-11-23T02:58:19.321Z");
});
