// Serves a TacLINK server's live data by Foxglove's WebSocket protocol: in Foxglove, Open connection, ws://127.0.0.1:8765.
// Frames, contacts and events are the API's own messages; skins, forces and where links sit are Foxglove's.
import foxglove from "@foxglove/ws-protocol";
import { WebSocketServer } from "ws";

import { encode, sceneOf, schemaOf, transformOf } from "./lib/foxglove.mjs";
import { patienceS } from "./lib/patience.mjs";
import { number, program } from "./lib/program.mjs";

const { FoxgloveServer } = foxglove;
const OPTIONS = {
  port: ["PORT", "to listen on, of this machine only; 0: any", "8765"],
  rate: ["HZ", "at most so many frames a second of each link", "10"],
};
const WAITING_BYTES = 4 << 20; // more for a client that reads too slowly is left out
const SILENCE_S = 10;
const ARM_PERIOD_MS = 1000;

class Channels {
  #server = new FoxgloveServer({ name: "TacLINK" });
  #ids = new Map();
  #wanted = new Set();

  constructor() {
    this.#server.on("subscribe", (id) => this.#wanted.add(id));
    this.#server.on("unsubscribe", (id) => this.#wanted.delete(id));
    this.#server.on("error", () => {}); // of one client, who is told by the protocol
  }

  add(topic, schemaName) {
    const channel = { topic, encoding: "protobuf", schemaName, schema: schemaOf(schemaName), schemaEncoding: "protobuf" };
    this.#ids.set(topic, { id: this.#server.addChannel(channel), schemaName });
  }

  /** message(): made only where somebody wants it. */
  send(topic, utcNs, message) {
    const { id, schemaName } = this.#ids.get(topic);
    if (this.#wanted.has(id)) this.#server.sendMessage(id, BigInt(utcNs), encode(schemaName, message()));
  }

  connect(socket, name) {
    const send = socket.send.bind(socket);
    socket.send = (data) => {
      if (typeof data === "string" || socket.bufferedAmount < WAITING_BYTES) send(data);
    };
    this.#server.handleConnection(socket, name);
  }
}

function listen(channels, port) {
  return new Promise((resolve, reject) => {
    const sockets = new WebSocketServer({
      host: "127.0.0.1",
      port,
      handleProtocols: (offered) =>
        offered.has(FoxgloveServer.SUPPORTED_SUBPROTOCOL) ? FoxgloveServer.SUPPORTED_SUBPROTOCOL : false,
    });
    sockets.on("connection", (socket, { socket: { remotePort } }) => channels.connect(socket, `:${remotePort}`));
    sockets.on("error", reject);
    sockets.on("listening", () => resolve(sockets));
  });
}

function timeOf({ exposure_utc_ns: ns }) {
  return ns === "0" ? String(BigInt(Date.now()) * 1_000_000n) : ns;
}

async function sendFrames({ tactile }, arm, channels, rate) {
  const grids = new Map(arm.links.map((link) => [link.name, link.model.markers]));
  const request = { detail: "DETAIL_GEOMETRY", max_rate_hz: rate };
  for await (const { frame } of tactile.streamFrames(request, { silenceS: patienceS(SILENCE_S) })) {
    if (!frame) continue;
    const ns = timeOf(frame.times);
    channels.send(`/links/${frame.link}/frame`, ns, () => frame);
    channels.send(`/links/${frame.link}/scene`, ns, () => sceneOf(frame, grids.get(frame.link)));
  }
}

async function sendContacts({ tactile }, channels, rate) {
  for await (const contacts of tactile.streamContacts({ max_rate_hz: rate }, { silenceS: patienceS(SILENCE_S) })) {
    channels.send("/contacts", contacts.utc_ns, () => contacts);
  }
}

async function sendEvents({ tactile }, channels) {
  for await (const { event } of tactile.streamEvents({}, { silenceS: patienceS(SILENCE_S) })) {
    if (event) channels.send("/events", event.times.raised_utc_ns, () => event);
  }
}

async function sendArm({ tactile }, channels) {
  for (;;) {
    const { arm } = await tactile.getArm();
    const ns = String(BigInt(Date.now()) * 1_000_000n);
    channels.send("/arm", ns, () => arm);
    for (const link of arm.links) channels.send("/transforms", ns, () => transformOf(link, ns));
    await new Promise((resolve) => setTimeout(resolve, ARM_PERIOD_MS));
  }
}

await program(OPTIONS, async (connection, options) => {
  const port = number("port", options.port, 0, 65535);
  const rate = number("rate", options.rate, 0.1, 1000);
  const { arm } = await connection.tactile.getArm();
  const channels = new Channels();
  channels.add("/arm", "taclink.v1.Arm");
  channels.add("/contacts", "taclink.v1.StreamContactsResponse");
  channels.add("/events", "taclink.v1.Event");
  channels.add("/transforms", "foxglove.FrameTransform");
  for (const { name } of arm.links) {
    channels.add(`/links/${name}/frame`, "taclink.v1.LinkFrame");
    channels.add(`/links/${name}/scene`, "foxglove.SceneUpdate");
  }
  const sockets = await listen(channels, port);
  console.log(`ws://127.0.0.1:${sockets.address().port}`);
  try {
    await Promise.race([
      sendFrames(connection, arm, channels, rate),
      sendContacts(connection, channels, rate),
      sendEvents(connection, channels),
      sendArm(connection, channels),
    ]);
    throw new Error("the server ended its streams");
  } finally {
    for (const socket of sockets.clients) socket.terminate();
    sockets.close();
  }
});
