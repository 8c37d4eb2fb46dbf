// The bridge to Foxglove, judged by Foxglove's own client.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { after, before, test } from "node:test";

import foxglove from "@foxglove/ws-protocol";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";
import { WebSocket } from "ws";

import { kill, NODE_FOLDER, Server, TOUCH, until } from "./server.mjs";

const { FoxgloveClient } = foxglove;
let server;
let bridge;
let client;
const channels = new Map();
const newest = new Map(); // by topic: decoded by the schema that was advertised

function typeOf({ schema, schemaName }) {
  const files = descriptor.FileDescriptorSet.decode(Buffer.from(schema, "base64"));
  return protobuf.Root.fromDescriptor(files).lookupType(schemaName);
}

before(async () => {
  server = await new Server().start();
  bridge = spawn(process.execPath, ["foxglove_bridge.mjs", "--server", server.address, "--port", "0"], { cwd: NODE_FOLDER });
  let output = "";
  bridge.stdout.on("data", (data) => (output += data));
  const url = await until("the bridge", () => /ws:\S+/.exec(output)?.[0]);
  client = new FoxgloveClient({ ws: new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]) });
  const bySubscription = new Map();
  client.on("advertise", (all) => {
    for (const channel of all) {
      channels.set(channel.topic, channel);
      bySubscription.set(client.subscribe(channel.id), { topic: channel.topic, type: typeOf(channel) });
    }
  });
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const { topic, type } = bySubscription.get(subscriptionId);
    newest.set(topic, { timestamp, message: type.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength)) });
  });
});

after(async () => {
  client?.close();
  await kill(bridge);
  await server?.stop();
});

async function next(topic, check) {
  return until(topic, () => {
    const { message } = newest.get(topic) ?? {};
    return message && check(message) ? message : null;
  });
}

test("frames and contacts are the API's", async () => {
  // Once the touch has settled.
  await next(`/links/${TOUCH.link}/frame`, ({ contacts, total_force_n: total }) => {
    return contacts.length === 1 && Math.abs(Math.hypot(total.x, total.y) - TOUCH.force_n) < 0.25 * TOUCH.force_n;
  });
  const contacts = await next("/contacts", (message) => message.contacts.length === 1);
  assert.equal(contacts.contacts[0].link, TOUCH.link);
  const { timestamp } = newest.get(`/links/${TOUCH.link}/frame`);
  assert.ok(Math.abs(Number(timestamp / 1_000_000n) - Date.now()) < 3_600_000, "UTC");
});

test("the skin is drawn, its touch as an arrow that ends on it", async () => {
  const scene = await next(`/links/${TOUCH.link}/scene`, (message) => message.entities[0]?.arrows.length === 1);
  const [{ arrows, triangles, frame_id: frameId }] = scene.entities;
  assert.equal(frameId, `link/${TOUCH.link}`);
  assert.equal(triangles[0].points.length, 240);
  assert.equal(triangles[0].indices.length, 3 * 2 * 24 * 9);
  assert.ok(triangles[0].indices.every((i) => i < 240));
  const { pose, shaft_length: shaft, head_length: head } = arrows[0];
  const { x, y, z, w } = pose.orientation;
  assert.ok(Math.abs(Math.hypot(x, y, z, w) - 1) < 1e-9);
  // The direction of +x, turned: inwards, from the touched side.
  const direction = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w)];
  const inwards = [-Math.cos(TOUCH.angle_rad), -Math.sin(TOUCH.angle_rad)];
  assert.ok(direction[0] * inwards[0] + direction[1] * inwards[1] > 0.95);
  const length = shaft + head;
  const tip = Math.hypot(pose.position.x + length * direction[0], pose.position.y + length * direction[1]);
  assert.ok(tip > 0.02 && tip < 0.04, `${tip} m from the axis`);
});

test("links are where the arm has them", async () => {
  const transform = await next("/transforms", () => true);
  assert.equal(transform.parent_frame_id, "base");
  assert.equal(transform.child_frame_id, `link/${TOUCH.link}`);
  assert.equal(transform.translation.z, 0.1);
  const arm = await next("/arm", () => true);
  assert.equal(arm.links.length, 1);
});

test("it ends when its server does", async () => {
  const ended = new Promise((resolve) => bridge.once("exit", resolve));
  await kill(server.process);
  assert.equal(await ended, 1);
});
